//! A QR code for a terminal.

use qrcode::render::unicode::Dense1x2;
use qrcode::{EcLevel, QrCode};

/// Returns the lines of a QR code, with dark modules as gaps; `None` if the text is too long.
pub fn qr(text: &str) -> Option<String> {
    let code = QrCode::with_error_correction_level(text, EcLevel::L).ok()?;
    // Most terminals are dark with light characters, so the light modules are drawn. The renderer draws `Dark` modules,
    // so the two colours are swapped.
    Some(code.render::<Dense1x2>().dark_color(Dense1x2::Light).light_color(Dense1x2::Dark).build())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn qr_code_has_a_margin_and_finder_patterns() {
        let code = qr("http://192.168.2.2:8881/login?token=0123456789abcdef0123456789abcdef").unwrap();
        let lines: Vec<&str> = code.lines().collect();
        assert!(lines.iter().all(|line| line.chars().count() == lines[0].chars().count()));
        assert!(lines[0].chars().all(|char| char == '█'), "the rim is drawn: {code}");
        assert!(lines[2].starts_with("████ ▄▄▄▄▄ █"), "an eye: {code}");
    }
}
