//! Pictures: composed as SVG, and rasterised from that same SVG, so that the two never differ.
//!
//! The drawings take plain structures ([`Grid`], [`landscape::Scene`], [`series::Sheet`], [`curves::Sheet`], [`distribution::Sheet`]) in the units that are
//! printed on them, and know nothing of scenarios.
//!
//! Limits: text is set in DejaVu Sans, which the program carries; a viewer of the SVG falls back to its own
//! sans-serif where that font is not installed.

mod canvas;
pub mod chart;
pub mod colour;
pub mod curves;
pub mod distribution;
mod font;
pub mod landscape;
mod marks;
pub mod scale;
pub mod series;

use std::fmt;

/// Pixels of the PNG for each unit of the SVG.
const PIXELS_PER_UNIT: f32 = 1.25;

/// Values in equal cells that tile a rectangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Cells along x.
    pub columns: usize,
    /// Cells along y.
    pub rows: usize,
    /// Left and right edge.
    pub x: [f64; 2],
    /// Lower and upper edge.
    pub y: [f64; 2],
    /// Row by row from the smallest y; not finite where there is no value.
    pub values: Vec<f64>,
}

/// A finished drawing.
#[derive(Clone, Debug)]
pub struct Picture {
    svg: String,
}

impl Picture {
    /// The drawing as an SVG document.
    #[must_use]
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// The drawing as a PNG file.
    ///
    /// # Errors
    /// Where the SVG cannot be read back or there is no memory for the pixels.
    pub fn png(&self) -> Result<Vec<u8>, DrawError> {
        self.png_at(PIXELS_PER_UNIT)
    }

    /// The drawing as a PNG file with so many pixels for each unit of the SVG.
    ///
    /// # Errors
    /// As [`Picture::png`].
    pub fn png_at(&self, pixels_per_unit: f32) -> Result<Vec<u8>, DrawError> {
        let tree = resvg::usvg::Tree::from_str(&self.svg, &font::options()).map_err(DrawError::new)?;
        let size = tree.size().to_int_size().scale_by(pixels_per_unit).ok_or_else(DrawError::size)?;
        let mut pixmap = resvg::tiny_skia::Pixmap::new(size.width(), size.height()).ok_or_else(DrawError::size)?;
        let scale = resvg::tiny_skia::Transform::from_scale(pixels_per_unit, pixels_per_unit);
        resvg::render(&tree, scale, &mut pixmap.as_mut());
        pixmap.encode_png().map_err(DrawError::new)
    }
}

/// A drawing that could not be made.
#[derive(Clone, Debug)]
pub struct DrawError(String);

impl DrawError {
    fn new(cause: impl fmt::Display) -> Self {
        Self(cause.to_string())
    }

    /// There is nothing to draw.
    #[must_use]
    pub fn nothing() -> Self {
        Self("there is nothing to draw".into())
    }

    fn size() -> Self {
        Self("the picture is too large".into())
    }
}

impl fmt::Display for DrawError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the picture could not be drawn: {}", self.0)
    }
}

impl std::error::Error for DrawError {}
