//! A metric over the domain.

use quietpath_core::Metric;
use quietpath_core::objective::point_values;

use crate::file::scenario::point;
use crate::file::{FileError, ScenarioFile};

/// What to look at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The figure.
    pub metric: Metric,
    /// Time, s: moving sensors stand where they are then.
    pub time: f64,
    /// Cells from west to east.
    pub columns: usize,
    /// Cells from south to north.
    pub rows: usize,
    /// Height of the slice in three dimensions, length units; the first agent's start where it is not given.
    pub height: Option<f64>,
}

/// Values at the centres of cells that tile the domain.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// The figure.
    pub metric: Metric,
    /// Time, s.
    pub time: f64,
    /// Height of the slice, length units; `None` in two dimensions.
    pub height: Option<f64>,
    /// East coordinates of the centres, length units, ascending.
    pub east: Vec<f64>,
    /// North coordinates of the centres, length units, ascending.
    pub north: Vec<f64>,
    /// Values, row by row from the south, each row from the west.
    pub values: Vec<f64>,
}

/// A metric at the centres of cells that tile the domain, for a single agent without controls.
///
/// # Errors
/// A location error where there are too few ranging sensors.
pub fn landscape(scenario: &ScenarioFile, view: &View) -> Result<Grid, Box<FileError>> {
    super::on_large_stack(|| match scenario.dimension {
        3 => landscape_in::<3>(scenario, view),
        _ => landscape_in::<2>(scenario, view),
    })
}

/// Every metric that the sensors give at the centres of cells that tile the domain, in the order of [`Metric::ALL`]; the
/// view's own metric is not asked.
///
/// # Errors
/// As the scenario's conversion to the core; a checked scenario has none.
pub fn landscapes(scenario: &ScenarioFile, view: &View) -> Result<Vec<Grid>, Box<FileError>> {
    super::on_large_stack(|| match scenario.dimension {
        3 => swept::<3>(scenario, view, &Metric::ALL),
        _ => swept::<2>(scenario, view, &Metric::ALL),
    })
}

/// Probability that the sensors detect an agent without controls at a position, length units, at a time, s.
///
/// # Errors
/// As the scenario's conversion to the core; a checked scenario has none.
pub fn detection_at(scenario: &ScenarioFile, time: f64, position: &[f64]) -> Result<f64, Box<FileError>> {
    super::on_large_stack(|| match scenario.dimension {
        3 => detection_in::<3>(scenario, time, position),
        _ => detection_in::<2>(scenario, time, position),
    })
}

fn detection_in<const DIM: usize>(
    scenario: &ScenarioFile,
    time: f64,
    position: &[f64],
) -> Result<f64, Box<FileError>> {
    let problem = scenario.to_core::<f64, DIM>()?;
    Ok(point_values(&problem.view(), time, &point::<f64, DIM>(position), &mut super::scratch::<DIM>()).detection)
}

fn landscape_in<const DIM: usize>(scenario: &ScenarioFile, view: &View) -> Result<Grid, Box<FileError>> {
    let grid = swept::<DIM>(scenario, view, &[view.metric])?.pop();
    grid.ok_or_else(|| too_few_ranging(scenario, view.metric))
}

/// Grids of those of `metrics` that the sensors give.
fn swept<const DIM: usize>(
    scenario: &ScenarioFile,
    view: &View,
    metrics: &[Metric],
) -> Result<Vec<Grid>, Box<FileError>> {
    let problem = scenario.to_core::<f64, DIM>()?;
    let start_height = scenario.agents.first().and_then(|agent| agent.start.get(2)).copied();
    let height = if DIM == 3 { view.height.or(start_height) } else { None };
    let centers = |axis: usize, count: usize| -> Vec<f64> {
        let bound = |bounds: &[f64]| bounds.get(axis).copied().unwrap_or_default();
        let (low, high) = (bound(&scenario.domain.min), bound(&scenario.domain.max));
        (0..count).map(|cell| low + (high - low) * (cell as f64 + 0.5) / count as f64).collect()
    };
    let (east, north) = (centers(0, view.columns), centers(1, view.rows));
    let mut scratch = super::scratch::<DIM>();
    let mut found = Vec::with_capacity(east.len() * north.len());
    for y in &north {
        for x in &east {
            let position = point::<f64, DIM>(&[*x, *y, height.unwrap_or_default()]);
            found.push(point_values(&problem.view(), view.time, &position, &mut scratch));
        }
    }
    let grid = |metric: &Metric| {
        let values: Option<Vec<f64>> = found.iter().map(|values| values.get(*metric)).collect();
        let (metric, time, east, north) = (*metric, view.time, east.clone(), north.clone());
        values.map(|values| Grid { metric, time, height, east, north, values })
    };
    Ok(metrics.iter().filter_map(grid).collect())
}

fn too_few_ranging(scenario: &ScenarioFile, metric: Metric) -> Box<FileError> {
    let have = scenario.sensors.iter().filter(|sensor| sensor.ranging.is_some()).count();
    let need = scenario.dimension + 1;
    let message = format!("has {have} sensors with `ranging`, and `{}` needs at least {need}", metric.name());
    let help = "give more sensors a `ranging` table, or look at `detection`, which needs none";
    Box::new(FileError::whole(scenario.file_name(), message, help))
}
