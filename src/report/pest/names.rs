//! Names as PEST has them: short, of small letters, digits and underscores, each once.

use std::collections::HashSet;

/// Gives names out.
pub(crate) struct Names {
    longest: usize,
    taken: HashSet<String>,
}

impl Names {
    pub(crate) fn new(longest: usize) -> Self {
        Names { longest, taken: HashSet::new() }
    }

    /// A name like `text` with `suffix` at its end. What stands in brackets (`offset_m[P1]`) tells names apart, so it
    /// is kept rather than what stands before.
    pub(crate) fn take(&mut self, text: &str, suffix: &str) -> String {
        let (stem, inside) = text.split_once('[').unwrap_or((text, ""));
        let (stem, inside) = (Some(plain(stem)).filter(|s| !s.is_empty()).unwrap_or("x".to_owned()), plain(inside));
        let room = self.longest.saturating_sub(suffix.len());
        let whole = if inside.is_empty() { stem.clone() } else { format!("{stem}_{inside}") };
        let short = match (whole.len() <= room, inside.is_empty()) {
            (true, _) => whole,
            (false, true) => cut(&stem, room).to_owned(),
            (false, false) => {
                let inside = cut(&inside, room / 2);
                format!("{}_{inside}", cut(&stem, room.saturating_sub(inside.len() + 1)))
            }
        };
        let numbered = (2..).map(|n: usize| {
            let end = format!("{n}{suffix}");
            format!("{}{end}", cut(&short, self.longest.saturating_sub(end.len())))
        });
        let mut candidates = std::iter::once(format!("{short}{suffix}")).chain(numbered);
        let name = candidates.find(|name| !self.taken.contains(name)).unwrap_or_default();
        self.taken.insert(name.clone());
        name
    }
}

/// Only what PEST takes in a name.
fn plain(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars().map(|c| c.to_ascii_lowercase()) {
        if c.is_ascii_alphanumeric() {
            out.push(c);
        } else if !out.ends_with('_') && !out.is_empty() {
            out.push('_');
        }
    }
    out.trim_end_matches('_').to_owned()
}

fn cut(text: &str, most: usize) -> &str {
    text[..text.len().min(most)].trim_end_matches('_')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_short_plain_and_each_given_once() {
        let mut names = Names::new(12);
        for (text, suffix, name) in [
            ("tau1_s", "", "tau1_s"),
            ("J1_per_GPa", "", "j1_per_gpa"),
            ("wave_speed_m_s", "", "wave_speed_m"),
            ("wave_speed_m_s", "", "wave_speed2"),
            ("initial_velocity_m_s", "_r1", "initial_v_r1"),
            ("initial_velocity_m_s", "_r12", "initial_r12"),
            ("offset_m[P1]", "", "offset_m_p1"),
            ("offset_m[P1]", "_r2", "offset_p1_r2"),
            ("offset_m[transducer 1]", "_r2", "offs_tran_r2"),
            ("offset_m[transducer 2]", "_r2", "offs_tra2_r2"),
            ("Druck (Ventil)", "_r1", "druck_ven_r1"),
            ("µ", "_r1", "x_r1"),
        ] {
            assert_eq!(names.take(text, suffix), name, "{text}{suffix}");
        }
        let mut many = Names::new(12);
        let all: HashSet<String> = (0..2000).map(|_| many.take("initial_velocity_m_s", "_r1")).collect();
        assert_eq!(all.len(), 2000);
        assert!(all.iter().all(|n| n.len() <= 12));
    }
}
