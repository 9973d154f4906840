//! A table of coloured cells whose values can be read: heat maps, correlations.

use std::fmt::Write;

use crate::report::text::escape::escape;

/// A coloured cell: class of its colour, and its text.
pub(crate) type Cell = Option<(&'static str, String)>;

/// The table; `corner` stands over the names of the rows. Names are text, cells without a value stay empty.
pub(crate) fn matrix(caption: &str, corner: &str, columns: &[String], rows: &[(String, Vec<Cell>)]) -> String {
    let mut out = format!(
        r#"<div class="scroll" tabindex="0" role="region" aria-label="{0}"><table class="matrix"><caption class="hidden">{0}</caption><thead><tr><th scope="col">{1}</th>"#,
        escape(caption),
        escape(corner)
    );
    for column in columns {
        let _ = write!(out, r#"<th scope="col" class="number">{}</th>"#, escape(column));
    }
    out.push_str("</tr></thead><tbody>\n");
    for (name, cells) in rows {
        let _ = write!(out, r#"<tr><th scope="row">{}</th>"#, escape(name));
        for cell in cells {
            match cell {
                Some((class, text)) => {
                    let _ = write!(out, r#"<td class="cell {class}">{text}</td>"#);
                }
                None => out.push_str("<td></td>"),
            }
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
    out
}
