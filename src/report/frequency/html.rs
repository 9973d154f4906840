//! The page of a frequency response: amplitude and phase of record and model at each sensor, and the table of
//! harmonics.

use std::fmt::Write;

use crate::fit::validate::frequency::SensorResponse;
use crate::report::frequency::text::{WINDOW, amplitude, heading, headings, phase, rows, verdict};
use crate::report::html::figures;
use crate::report::html::page::{footer, minus, still_head, table};
use crate::report::text::escape::escape;

/// The page as one HTML document, without scripts.
pub fn html(title: &str, against: &str, sensors: &[SensorResponse]) -> String {
    let (sentence, has_it) = verdict(sensors);
    let mark = match has_it {
        Some(true) => ("✓", "good"),
        Some(false) => ("✗", "missing"),
        None => ("?", "unknown"),
    };
    let kicker = format!("frequency response, {against}");
    let mut out = still_head(title, "frequency", &kicker, mark, &sentence);
    for (i, sensor) in sensors.iter().enumerate() {
        let _ = write!(
            out,
            "<section id=\"sensor-{i}\"><h2>{}</h2>\n<p class=\"facts\">{}</p>\n{}",
            escape(&sensor.name),
            escape(&heading(sensor)),
            figures::plates(&[("Amplitude".to_owned(), amplitude(sensor)), ("Phase".to_owned(), phase(sensor))]),
        );
        let cells = rows(sensor).into_iter().map(|row| row.map(|cell| minus(&escape(&cell))).to_vec());
        out.push_str(&table(
            &format!("Harmonics at {}", sensor.name),
            &headings(),
            &[0, 1, 2, 3, 4, 5, 6, 7, 8],
            cells,
        ));
        out.push_str("</section>\n");
    }
    let _ = writeln!(
        out,
        "<p class=\"note\">Dotted: n·a/4L, n odd, of the elastic pipe. Shift: where the record has the harmonic, relative to that. {}</p>",
        escape(WINDOW)
    );
    out.push_str(&footer(""));
    out.push_str("</body>\n</html>\n");
    out
}
