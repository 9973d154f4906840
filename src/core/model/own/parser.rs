//! The language of laws: numbers, `+ - * / ^`, comparisons, `and or not`, `if(c, a, b)` and a few functions.

use crate::model::own::number::{Binary, Unary};
use crate::model::own::program::Program;

/// What is wrong with a law, and where: the byte at which it begins.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Byte of the law.
    pub at: usize,
    /// What is wrong and what is allowed.
    pub message: String,
}

/// Brackets and signs inside one another, at most: each takes room on the stack.
const MOST_DEPTH: usize = 60;
/// Steps of one law, at most. Each is run at every step of time.
const MOST_STEPS: usize = 500;
/// Bytes of one law, at most.
const LONGEST: usize = 10_000;

const ONE: [(&str, Unary); 7] = [
    ("abs", Unary::Abs),
    ("sign", Unary::Sign),
    ("sqrt", Unary::Sqrt),
    ("exp", Unary::Exp),
    ("ln", Unary::Ln),
    ("sin", Unary::Sin),
    ("cos", Unary::Cos),
];
const TWO: [(&str, Binary); 2] = [("min", Binary::Min), ("max", Binary::Max)];
/// Words that are no names.
pub const WORDS: [&str; 15] =
    ["and", "or", "not", "if", "min", "max", "abs", "sign", "sqrt", "exp", "ln", "sin", "cos", "g", "pi"];

/// Compiles a law. `names` are the inputs that it may read, by their numbers; `hint` says why one that is not there is
/// missing.
///
/// # Errors
/// The first fault.
pub fn parse(text: &str, names: &[(&str, usize)], hint: &dyn Fn(&str) -> Option<String>) -> Result<Program, Fault> {
    if text.len() > LONGEST {
        let message = format!("the law has {} characters, and {LONGEST} are the most", text.len());
        return Err(Fault { at: 0, message });
    }
    let mut parser = Parser { text, at: 0, depth: 0, names, hint, program: Program::default() };
    let last = parser.either()?;
    match parser.rest().chars().next() {
        None => Ok(parser.program.ending(last)),
        Some(')') => Err(parser.fault("this ')' closes nothing")),
        Some('=') => Err(parser.fault("write == to compare: a law has no assignments")),
        Some(c) => Err(parser.fault(&format!("an operator such as + or * is missing before '{c}'"))),
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    names: &'a [(&'a str, usize)],
    hint: &'a dyn Fn(&str) -> Option<String>,
    program: Program,
}

type Parsed = Result<usize, Fault>;

impl<'a> Parser<'a> {
    fn fault(&self, message: &str) -> Fault {
        Fault { at: self.at, message: message.to_owned() }
    }

    /// What follows, without the space before it.
    fn rest(&mut self) -> &'a str {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        &self.text[self.at..]
    }

    fn takes(&mut self, sign: &str) -> bool {
        let found = self.rest().starts_with(sign);
        self.at += if found { sign.len() } else { 0 };
        found
    }

    /// The word that follows.
    fn word(&mut self) -> &'a str {
        let rest = self.rest();
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        &rest[..end]
    }

    fn takes_word(&mut self, word: &str) -> bool {
        let found = self.word() == word;
        self.at += if found { word.len() } else { 0 };
        found
    }

    fn two(&mut self, f: Binary, a: usize, b: usize) -> Parsed {
        let at = self.program.two(f, a, b);
        self.within(at)
    }

    fn within(&self, at: usize) -> Parsed {
        if self.program.count() > MOST_STEPS {
            return Err(self.fault(&format!("the law has more than {MOST_STEPS} steps")));
        }
        Ok(at)
    }

    /// Runs `inner` one level deeper.
    fn deeper(&mut self, inner: impl FnOnce(&mut Self) -> Parsed) -> Parsed {
        if self.depth == MOST_DEPTH {
            return Err(self.fault(&format!("more than {MOST_DEPTH} brackets or signs inside one another")));
        }
        self.depth += 1;
        let found = inner(self);
        self.depth -= 1;
        found
    }

    fn either(&mut self) -> Parsed {
        let mut a = self.both()?;
        while self.takes_word("or") {
            let b = self.both()?;
            a = self.two(Binary::Or, a, b)?;
        }
        Ok(a)
    }

    fn both(&mut self) -> Parsed {
        let mut a = self.negated()?;
        while self.takes_word("and") {
            let b = self.negated()?;
            a = self.two(Binary::And, a, b)?;
        }
        Ok(a)
    }

    fn negated(&mut self) -> Parsed {
        if self.takes_word("not") {
            let a = self.deeper(Self::negated)?;
            let at = self.program.one(Unary::Not, a);
            return self.within(at);
        }
        self.compared()
    }

    fn compared(&mut self) -> Parsed {
        let a = self.sum()?;
        // The longer sign first.
        let signs = [
            ("<=", Binary::AtMost, false),
            (">=", Binary::AtMost, true),
            ("==", Binary::Equal, false),
            ("!=", Binary::NotEqual, false),
            ("<", Binary::Less, false),
            (">", Binary::Less, true),
        ];
        let Some(&(_, f, turned)) = signs.iter().find(|(sign, ..)| self.takes(sign)) else { return Ok(a) };
        let b = self.sum()?;
        let rest = self.rest();
        if rest.starts_with(['<', '>']) || rest.starts_with("==") {
            return Err(self.fault("compare two at a time, and join the comparisons with 'and'"));
        }
        let (a, b) = if turned { (b, a) } else { (a, b) };
        self.two(f, a, b)
    }

    fn sum(&mut self) -> Parsed {
        let mut a = self.product()?;
        loop {
            let f = if self.takes("+") {
                Binary::Plus
            } else if self.takes("-") {
                Binary::Minus
            } else {
                return Ok(a);
            };
            let b = self.product()?;
            a = self.two(f, a, b)?;
        }
    }

    fn product(&mut self) -> Parsed {
        let mut a = self.signed()?;
        loop {
            if self.rest().starts_with("**") {
                return Err(self.fault("write ^ for a power"));
            }
            let f = if self.takes("*") {
                Binary::Times
            } else if self.takes("/") {
                Binary::By
            } else {
                return Ok(a);
            };
            let b = self.signed()?;
            a = self.two(f, a, b)?;
        }
    }

    /// `-a^b` is `-(a^b)`, and `a^-b` is allowed.
    fn signed(&mut self) -> Parsed {
        if self.takes("-") {
            let a = self.deeper(Self::signed)?;
            let at = self.program.one(Unary::Minus, a);
            return self.within(at);
        }
        let a = self.atom()?;
        if self.takes("^") {
            let b = self.deeper(Self::signed)?;
            return self.two(Binary::Power, a, b);
        }
        Ok(a)
    }

    fn atom(&mut self) -> Parsed {
        if self.takes("(") {
            let a = self.deeper(Self::either)?;
            return self.closed(a);
        }
        let rest = self.rest();
        let Some(first) = rest.chars().next() else {
            return Err(self.fault("the law ends where a number, a name or a bracket should follow"));
        };
        if first.is_ascii_digit() || first == '.' {
            return self.literal(rest);
        }
        let word = self.word();
        if word.is_empty() {
            return Err(self.fault(&format!("'{first}' where a number, a name or a bracket should stand")));
        }
        let begun = self.at;
        self.at += word.len();
        match word {
            "g" => return Ok(self.program.number(crate::units::GRAVITY_M_S2)),
            "pi" => return Ok(self.program.number(std::f64::consts::PI)),
            _ => {}
        }
        if let Some(&(_, input)) = self.names.iter().find(|(name, _)| *name == word) {
            if self.rest().starts_with('(') {
                return Err(Fault { at: begun, message: format!("'{word}' is no function; write * to multiply") });
            }
            let at = self.program.input(input);
            return self.within(at);
        }
        let count = if word == "if" {
            3
        } else if TWO.iter().any(|(n, _)| *n == word) {
            2
        } else {
            1
        };
        let known = word == "if" || WORDS[4..13].contains(&word);
        if !known {
            self.at = begun;
            return Err(self.fault(&self.unknown(word)));
        }
        let of = self.arguments(word, begun, count)?;
        let at = match (TWO.iter().find(|(n, _)| *n == word), ONE.iter().find(|(n, _)| *n == word)) {
            (Some((_, f)), _) => self.program.two(*f, of[0], of[1]),
            (_, Some((_, f))) => self.program.one(*f, of[0]),
            _ => self.program.choose(of[0], of[1], of[2]),
        };
        self.within(at)
    }

    fn unknown(&self, word: &str) -> String {
        if let Some(why) = (self.hint)(word) {
            return why;
        }
        let names = self.names.iter().map(|(name, _)| *name).chain(WORDS);
        let alike = |name: &str| strsim::jaro_winkler(&name.to_lowercase(), &word.to_lowercase());
        let nearest = names.clone().max_by(|a, b| alike(a).total_cmp(&alike(b))).filter(|n| alike(n) > 0.7);
        let meant = nearest.map_or(String::new(), |n| format!("; did you mean '{n}'?"));
        format!("unknown name '{word}'{meant} Known are {}", names.collect::<Vec<_>>().join(", "))
            .replace("' Known", "'. Known")
    }

    fn arguments(&mut self, word: &str, begun: usize, count: usize) -> Result<Vec<usize>, Fault> {
        let wants = |given: &str| Fault {
            at: begun,
            message: format!("{word} takes {count} argument{}, not {given}", if count == 1 { "" } else { "s" }),
        };
        if !self.takes("(") {
            return Err(wants("none: its bracket is missing"));
        }
        let mut of = Vec::new();
        loop {
            if self.rest().starts_with(')') {
                self.at += 1;
                return if of.len() == count { Ok(of) } else { Err(wants(&of.len().to_string())) };
            }
            of.push(self.deeper(Self::either)?);
            if of.len() > count {
                return Err(wants("more"));
            }
            if !self.takes(",") && !self.rest().starts_with(')') {
                return Err(self.fault(&format!("a comma or ')' is missing here, in {word}(…)")));
            }
        }
    }

    fn closed(&mut self, a: usize) -> Parsed {
        if self.takes(")") { Ok(a) } else { Err(self.fault("a ')' is missing here")) }
    }

    fn literal(&mut self, rest: &str) -> Parsed {
        let mut end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        if let Some(power) = rest[end..].strip_prefix(['e', 'E']) {
            let digits = power.strip_prefix(['+', '-']).unwrap_or(power);
            let count = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
            end = if count > 0 { rest.len() - digits.len() + count } else { end };
        }
        let value: f64 = match rest[..end].parse() {
            Ok(value) if f64::is_finite(value) => value,
            _ => return Err(self.fault(&format!("'{}' is no number", &rest[..end.min(40)]))),
        };
        self.at += end;
        Ok(self.program.number(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::own::number::{Dual, NODES, Number as _, Wide};
    use std::fmt::Write as _;

    const NAMES: [(&str, usize); 2] = [("H", 0), ("cda_mm2", 1)];

    fn compiled(text: &str) -> Result<Program, Fault> {
        parse(text, &NAMES, &|_| None)
    }

    fn at(text: &str, h: f64) -> Dual {
        let program = compiled(text).unwrap_or_else(|f| panic!("{text}: {f:?}"));
        let wide = program.run(|i| Wide::of([h, 2.0][i]), &mut Vec::new());
        let dual = program.run(|i| if i == 0 { Dual(h, 1.0) } else { Dual(2.0, 0.0) }, &mut Vec::new());
        assert!(wide.0 == [dual.0; NODES] || dual.0.is_nan(), "{text}");
        dual
    }

    #[test]
    fn operators_bind_as_in_mathematics() {
        for (text, value) in [
            ("1 + 2 * 3", 7.0),
            ("2 ^ 3 ^ 2", 512.0),
            ("-2 ^ 2", -4.0),
            ("2^-1", 0.5),
            ("8 / 4 / 2", 1.0),
            ("7 - 4 - 2", 1.0),
            ("H > 3 and not (H > 5) or H < 0", 1.0),
            ("if(H >= 4, 10, 20) + if(H != 4, 1, 2)", 12.0),
            ("min(H, 3) + max(H, 9) + abs(-1.5e0)", 13.5),
            ("sign(0) + sign(-3) + sqrt(16) + exp(0) + ln(1)", 4.0),
            ("sin(pi/2) + cos(pi)", 0.0),
            ("cda_mm2*1e-6", 2e-6),
        ] {
            assert!((at(text, 4.0).0 - value).abs() < 1e-12, "{text}: {:?}", at(text, 4.0));
        }
    }

    #[test]
    fn derivatives_are_those_of_small_differences() {
        for text in [
            "H^2 / (H + 1) - cda_mm2 ^ H",
            "sqrt(H) * exp(-H) + ln(H) * sin(3 * H) - cos(H)",
            "if(H > 1, abs(H - 9), H) + max(H, 0.5 * H) + min(H, 2)",
        ] {
            for h in [0.7, 2.9, 6.1] {
                let numeric = (at(text, h + 1e-6).0 - at(text, h - 1e-6).0) / 2e-6;
                assert!((at(text, h).1 - numeric).abs() < 1e-6 * (1.0 + numeric.abs()), "{text} at {h}");
            }
        }
    }

    #[test]
    fn a_fault_says_where_and_what_was_meant() {
        for (text, column, words) in [
            ("cda_mm * 2", 0, "did you mean 'cda_mm2'"),
            ("2 * Sqrt(H)", 4, "did you mean 'sqrt'"),
            ("2 * (H + 1", 10, "')' is missing"),
            ("2 H", 2, "operator"),
            ("if(H > 1, 2)", 0, "3 arguments, not 2"),
            ("sqrt H", 0, "bracket"),
            ("1 < H < 3", 6, "and"),
            ("H = 3", 2, "=="),
            ("H ** 2", 2, "^"),
            ("H(3)", 0, "no function"),
            ("", 0, "ends"),
            ("1..2", 0, "no number"),
            ("H)", 1, "closes nothing"),
            ("2 * ", 4, "ends"),
            ("H + é", 4, "unknown name"),
        ] {
            let fault = compiled(text).unwrap_err();
            assert!(fault.at == column && fault.message.contains(words), "{text}: {fault:?}");
        }
    }

    #[test]
    fn hostile_laws_are_refused() {
        let mut long = String::from("H");
        (0..900).for_each(|i| write!(long, "+{i}*H").unwrap());
        let deep = |sign: &str, n| format!("{}H", sign.repeat(n));
        for (text, words) in [
            (long, "steps"),
            (deep("(", 100_000), "characters"),
            (deep("(", 5_000), "inside one another"),
            (deep("-", 5_000), "inside one another"),
            (deep("not ", 2_000), "inside one another"),
            (deep("2^", 4_000), "inside one another"),
            (deep("abs(", 2_000), "inside one another"),
        ] {
            let fault = compiled(&text).unwrap_err();
            assert!(fault.message.contains(words), "{fault:?}");
        }
    }
}
