//! The font of the pictures: DejaVu Sans, carried in the program so that no font need be installed.

use std::sync::{Arc, LazyLock};

use resvg::usvg;
use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider as _};

/// What SVG viewers are asked for, first the font that the program carries.
pub const FAMILY: &str = "DejaVu Sans, Verdana, Arial, sans-serif";

/// Ratio of a letter's width to the size of the font, where the font does not know the letter.
const USUAL_WIDTH: f64 = 0.6;

static FONTS: LazyLock<Arc<usvg::fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.load_font_data(dejavu::sans::bold().to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    Arc::new(fonts)
});

/// How an SVG is read: with our font and nothing from the system.
pub fn options() -> usvg::Options<'static> {
    usvg::Options { fontdb: Arc::clone(&FONTS), ..usvg::Options::default() }
}

/// Width of `text` at `size`, in the units of `size`.
#[must_use]
pub fn width(text: &str, size: f64) -> f64 {
    let count = || f64::from(u32::try_from(text.chars().count()).unwrap_or(u32::MAX));
    let Ok(font) = FontRef::new(dejavu::sans::regular()) else { return count() * size * USUAL_WIDTH };
    let (letters, metrics) = (font.charmap(), font.glyph_metrics(Size::new(1000.0), LocationRef::default()));
    let advance = |letter: char| letters.map(letter).and_then(|glyph| metrics.advance_width(glyph));
    text.chars().map(|letter| advance(letter).map_or(USUAL_WIDTH, |width| f64::from(width) / 1000.0) * size).sum()
}

#[cfg(test)]
mod tests {
    use super::width;

    #[test]
    fn text_is_measured_letter_by_letter() {
        // Advance of DejaVu Sans "m" is 1995 of 2048 units.
        assert!((width("m", 100.0) - 100.0 * 1995.0 / 2048.0).abs() < 0.01, "{}", width("m", 100.0));
        assert!(width("iiii", 10.0) < width("mmmm", 10.0));
        assert!((width("", 10.0)).abs() < 1e-12);
    }
}
