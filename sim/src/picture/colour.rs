//! Colour maps and the heat map as an embedded picture.
//!
//! Viridis rises evenly in lightness and stays readable without red-green sight. A heat map becomes a PNG with one
//! palette entry a colour, so that a landscape of several hundred cells a side weighs some tens of kilobytes.
//!
//! Limits: 256 colours; cells whose value is not finite are grey.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::Grid;
use super::scale::Scale;

/// Colours of agents: distinct from viridis, from each other, and without red-green sight.
const AGENTS: [&str; 8] = ["#d6361f", "#0b6fc2", "#c2449a", "#111111", "#e58b00", "#46b4ef", "#7a4a1d", "#767676"];

/// The palette entry of cells without a value.
const NO_VALUE: u8 = 255;

/// The colour of agent `index`, as CSS.
#[must_use]
pub fn agent(index: usize) -> &'static str {
    AGENTS.iter().cycle().nth(index % AGENTS.len()).copied().unwrap_or("#000000")
}

/// The colour at `share` (0 to 1) of the map, as CSS.
#[must_use]
pub fn css(share: f64) -> String {
    let colour = colorous::VIRIDIS.eval_continuous(share.clamp(0.0, 1.0));
    format!("#{colour:x}")
}

/// The colour at `share` (0 to 1) of a sweep, as CSS: from pale to dark red, which no part of viridis is.
#[must_use]
pub fn swept(share: f64) -> String {
    /// The palest colours of the map do not show on white.
    const PALEST: f64 = 0.3;
    let colour = colorous::ORANGE_RED.eval_continuous(PALEST + (1.0 - PALEST) * share.clamp(0.0, 1.0));
    format!("#{colour:x}")
}

/// A grid as a PNG data URI, its last row (largest y) on top.
///
/// # Errors
/// What the PNG encoder says.
pub fn heat_map(grid: &Grid, scale: &Scale) -> Result<String, png::EncodingError> {
    let mut pixels = Vec::with_capacity(grid.values.len());
    for row in grid.values.chunks(grid.columns.max(1)).rev() {
        pixels.extend(row.iter().map(|value| index(scale.share(*value))));
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size(grid.columns), size(grid.rows));
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette());
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&pixels)?;
    writer.finish()?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(&bytes)))
}

fn size(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

fn palette() -> Vec<u8> {
    let colours = (0..NO_VALUE).map(|entry| {
        let colour = colorous::VIRIDIS.eval_rational(usize::from(entry), usize::from(NO_VALUE));
        [colour.r, colour.g, colour.b]
    });
    colours.chain([[160, 160, 160]]).flatten().collect()
}

fn index(share: f64) -> u8 {
    if share.is_finite() { (share.clamp(0.0, 1.0) * f64::from(NO_VALUE - 1)).round() as u8 } else { NO_VALUE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_the_map_are_viridis() {
        assert_eq!(css(0.0), "#440154");
        assert_eq!(css(1.0), "#fde725");
    }

    #[test]
    fn largest_y_is_the_top_row() {
        let grid = Grid { columns: 1, rows: 2, x: [0.0, 1.0], y: [0.0, 1.0], values: vec![0.0, 1.0] };
        let uri = heat_map(&grid, &Scale::linear(0.0, 1.0)).unwrap();
        let bytes = STANDARD.decode(uri.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = [0; 2];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, [254, 0]);
    }

    #[test]
    fn a_cell_without_a_value_is_grey() {
        assert_eq!(index(f64::NAN), NO_VALUE);
        assert_eq!(index(2.0), 254);
    }
}
