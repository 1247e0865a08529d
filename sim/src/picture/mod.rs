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

use std::collections::BTreeMap;
use std::fmt;

/// Pixels of the PNG for each unit of the SVG.
const PIXELS_PER_UNIT: f32 = 1.25;

/// Colours of a small PNG that are exactly those of the drawing.
const FLAT: usize = 56;

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
        self.pixels(pixels_per_unit)?.encode_png().map_err(DrawError::new)
    }

    /// The drawing as a PNG file of 256 colours, a third of the size of [`Picture::png_at`].
    ///
    /// # Errors
    /// As [`Picture::png`].
    pub fn small_png_at(&self, pixels_per_unit: f32) -> Result<Vec<u8>, DrawError> {
        let pixels = self.pixels(pixels_per_unit)?;
        let (palette, index) = few_colours(pixels.data());
        let indices: Vec<u8> =
            pixels.data().chunks_exact(4).map(|pixel| index.get(pixel).copied().unwrap_or(0)).collect();
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, pixels.width(), pixels.height());
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(palette);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().map_err(DrawError::new)?;
        writer.write_image_data(&indices).map_err(DrawError::new)?;
        writer.finish().map_err(DrawError::new)?;
        Ok(bytes)
    }

    fn pixels(&self, pixels_per_unit: f32) -> Result<resvg::tiny_skia::Pixmap, DrawError> {
        let tree = resvg::usvg::Tree::from_str(&self.svg, &font::options()).map_err(DrawError::new)?;
        let size = tree.size().to_int_size().scale_by(pixels_per_unit).ok_or_else(DrawError::size)?;
        let mut pixmap = resvg::tiny_skia::Pixmap::new(size.width(), size.height()).ok_or_else(DrawError::size)?;
        let scale = resvg::tiny_skia::Transform::from_scale(pixels_per_unit, pixels_per_unit);
        // The sheet may end within the last pixels.
        pixmap.fill(resvg::tiny_skia::Color::WHITE);
        resvg::render(&tree, scale, &mut pixmap.as_mut());
        Ok(pixmap)
    }
}

/// A palette of 256 colours, and the entry of each colour of some pixels: its own where it is one of the [`FLAT`] that most
/// pixels have, as paper, text and lines do, and otherwise the nearest of those that shades are mixed from.
fn few_colours(pixels: &[u8]) -> (Vec<u8>, BTreeMap<&[u8], u8>) {
    let mut counts: BTreeMap<&[u8], usize> = BTreeMap::new();
    for pixel in pixels.chunks_exact(4) {
        *counts.entry(pixel).or_default() += 1;
    }
    let mut colours: Vec<(&[u8], usize)> = counts.into_iter().collect();
    colours.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let (flat, shades) = colours.split_at(FLAT.min(colours.len()));
    let mixed: Vec<u8> = shades.iter().flat_map(|(colour, count)| colour.repeat((*count).clamp(1, FLAT))).collect();
    let mut palette: Vec<u8> = flat.iter().flat_map(|(colour, _)| colour.iter().take(3)).copied().collect();
    let entry = |at: usize| u8::try_from(at).unwrap_or(u8::MAX);
    let mut index: BTreeMap<&[u8], u8> =
        flat.iter().enumerate().map(|(at, (colour, _))| (*colour, entry(at))).collect();
    if !shades.is_empty() {
        let mixer = color_quant::NeuQuant::new(1, 256 - FLAT, &mixed);
        palette.extend(mixer.color_map_rgb());
        index.extend(shades.iter().map(|(colour, _)| (*colour, entry(FLAT + mixer.index_of(colour)))));
    }
    (palette, index)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_pictures_keep_the_colours_of_lines_and_the_size() {
        let line = r##"<line x1="2" y1="3" x2="38" y2="3" stroke="#d6361f" stroke-width="2"/>"##;
        let shades: String = (0..600)
            .map(|at| {
                format!(
                    r##"<rect x="{}" y="{}" width="1" height="1" fill="#{:06x}"/>"##,
                    at % 40,
                    8 + at / 40,
                    4001 * at
                )
            })
            .collect();
        let svg = format!(r#"<svg xmlns="http://www.w3.org/2000/svg" width="40" height="30">{line}{shades}</svg>"#);
        let bytes = Picture { svg }.small_png_at(1.0).expect("a picture");
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().expect("a PNG");
        let mut pixels = vec![0; 3 * 40 * 30];
        let frame = reader.next_frame(&mut pixels).expect("pixels");
        assert_eq!((frame.width, frame.height), (40, 30));
        let at = |x: usize, y: usize| &pixels[3 * (40 * y + x)..][..3];
        assert_eq!((at(0, 0), at(20, 3)), (&[255, 255, 255][..], &[0xd6, 0x36, 0x1f][..]));
    }
}
