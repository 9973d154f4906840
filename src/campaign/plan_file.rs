//! A plan file, read: what is written in it, each fault with its line.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::ops::Range;
use std::path::Path;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use toml::de::DeTable;

use crate::campaign::error::{CampaignError, Result};
use crate::campaign::perform::METHODS;
use crate::fit::search::options::Options as Usual;
use crate::model::effects::{Chosen, parse_list};
use crate::shown::Shown as _;
use crate::storage::nearest::nearest;
use crate::text_file::read_text;

/// What a campaign does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Fits.
    Calibrate,
    /// Diagnoses.
    Diagnose,
    /// Diagnoses whose answers are known.
    Reliability,
    /// Closures on rigs.
    Simulate,
    /// Sensitivity studies of rigs.
    Sensitivity,
}

const KINDS: [(&str, Kind); 5] = [
    ("calibrate", Kind::Calibrate),
    ("diagnose", Kind::Diagnose),
    ("reliability", Kind::Reliability),
    ("simulate", Kind::Simulate),
    ("sensitivity", Kind::Sensitivity),
];

/// A key, and the kinds that have it.
type Key = (&'static str, &'static [Kind]);

const ALL: &[Kind] = &[Kind::Calibrate, Kind::Diagnose, Kind::Reliability, Kind::Simulate, Kind::Sensitivity];
const OF_RECORDINGS: &[Kind] = &[Kind::Calibrate, Kind::Diagnose, Kind::Reliability];
const OF_RIGS: &[Kind] = &[Kind::Simulate, Kind::Sensitivity];
const FITS: &[Kind] = &[Kind::Calibrate];
const KNOWN: &[Kind] = &[Kind::Reliability];
const DESIGNS: &[Kind] = &[Kind::Sensitivity];

const KEYS: [Key; 14] = [
    ("kind", ALL),
    ("recordings", OF_RECORDINGS),
    ("case", OF_RECORDINGS),
    ("rig", OF_RECORDINGS),
    ("rigs", OF_RIGS),
    ("effects", ALL),
    ("truth", KNOWN),
    ("methods", &[Kind::Calibrate, Kind::Sensitivity]),
    ("starts", ALL),
    ("seed", ALL),
    ("set", OF_RIGS),
    ("range", OF_RIGS),
    ("only", DESIGNS),
    ("options", &[Kind::Calibrate, Kind::Diagnose, Kind::Reliability, Kind::Sensitivity]),
];
const OPTIONS: [Key; 10] = [
    ("most_reaches", OF_RECORDINGS),
    ("random_starts", OF_RECORDINGS),
    ("hold", OF_RECORDINGS),
    ("ignore", OF_RECORDINGS),
    ("budget", FITS),
    ("misfit", FITS),
    ("within", DESIGNS),
    ("sensor", DESIGNS),
    ("trajectories", DESIGNS),
    ("rows", DESIGNS),
];
const CASE: [Key; 4] =
    [("name", OF_RECORDINGS), ("recordings", OF_RECORDINGS), ("effects", OF_RECORDINGS), ("truth", KNOWN)];

/// See the module.
#[derive(Debug, Deserialize)]
pub struct PlanFile {
    kind: Spanned<String>,
    /// Files that are used one by one, as patterns.
    #[serde(default, deserialize_with = "list")]
    pub recordings: Vec<Spanned<String>>,
    /// The rig that replaces the one in the recordings.
    pub rig: Option<Spanned<String>>,
    /// Rigs that are simulated, as patterns.
    #[serde(default, deserialize_with = "list")]
    pub rigs: Vec<Spanned<String>>,
    /// Models.
    #[serde(default, deserialize_with = "list")]
    pub effects: Vec<Spanned<Vec<String>>>,
    /// What is hidden in the recordings.
    pub truth: Option<Spanned<String>>,
    /// How to search.
    #[serde(default, deserialize_with = "list")]
    pub methods: Vec<Spanned<String>>,
    /// How many seeds.
    pub starts: Option<Spanned<Count<u32>>>,
    /// The first seed.
    #[serde(default = "first_seed")]
    pub seed: Count<u64>,
    /// Recordings that are used together.
    #[serde(default, deserialize_with = "list")]
    pub case: Vec<Spanned<Case>>,
    /// Values, each one number or several.
    #[serde(default)]
    pub set: BTreeMap<String, Spanned<Values>>,
    /// Ranges that values are drawn from.
    #[serde(default)]
    pub range: BTreeMap<String, Spanned<[f64; 2]>>,
    /// Parameters that vary.
    #[serde(default, deserialize_with = "list")]
    pub only: Vec<String>,
    /// See the keys of `calibrate` and `sensitivity`.
    #[serde(default)]
    pub options: Options,
}

fn first_seed() -> Count<u64> {
    Count::Is(1)
}

/// Recordings of one rig that are used together.
#[derive(Debug, Deserialize)]
#[serde(expecting = "a table: [[case]]")]
pub struct Case {
    /// What people call it.
    pub name: Option<String>,
    /// Files, as patterns.
    #[serde(deserialize_with = "list")]
    pub recordings: Vec<Spanned<String>>,
    /// Models, instead of those of the plan.
    #[serde(default, deserialize_with = "list")]
    pub effects: Vec<Spanned<Vec<String>>>,
    /// What is hidden in it.
    pub truth: Option<Spanned<String>>,
}

/// A whole number.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected a whole number, 0 or more")]
pub enum Count<T> {
    /// So many.
    Is(T),
}

impl<T: Copy> Count<T> {
    /// The number.
    pub fn get(self) -> T {
        let Count::Is(number) = self;
        number
    }
}

/// A list, with words for one who writes something else.
fn list<'de, D: Deserializer<'de>, T: Deserialize<'de>>(source: D) -> std::result::Result<Vec<T>, D::Error> {
    struct Items<T>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>> Visitor<'de> for Items<T> {
        type Value = Vec<T>;

        fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
            out.write_str("a list, in brackets: [\"…\"]")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> std::result::Result<Vec<T>, A::Error> {
            let mut all = Vec::new();
            while let Some(item) = items.next_element()? {
                all.push(item);
            }
            Ok(all)
        }
    }
    source.deserialize_seq(Items(PhantomData))
}

/// A number or several.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "expected a number, or several in brackets: [0.1, 0.2]")]
pub enum Values {
    /// One.
    One(f64),
    /// Several: a task each.
    Several(Vec<f64>),
}

/// Options, as the commands have them.
#[derive(Debug, Deserialize)]
#[serde(default, expecting = "a table: [options]")]
#[allow(missing_docs)] // the commands' help says it
pub struct Options {
    pub most_reaches: Spanned<Count<usize>>,
    pub random_starts: Option<Count<usize>>,
    pub budget: Count<usize>,
    pub misfit: Spanned<String>,
    pub hold: BTreeMap<String, Spanned<Values>>,
    #[serde(deserialize_with = "list")]
    pub ignore: Vec<String>,
    pub within: Option<Spanned<f64>>,
    pub sensor: Option<String>,
    pub trajectories: Count<usize>,
    pub rows: Count<usize>,
}

impl Default for Options {
    fn default() -> Self {
        let usual = Usual::default();
        Options {
            most_reaches: Spanned::new(0..0, Count::Is(usual.most_reaches)),
            random_starts: None,
            budget: Count::Is(usual.budget),
            misfit: Spanned::new(0..0, "time".to_owned()),
            hold: BTreeMap::new(),
            ignore: Vec::new(),
            within: None,
            sensor: None,
            trajectories: Count::Is(50),
            rows: Count::Is(512),
        }
    }
}

/// The text of a plan file, for its faults.
pub struct Source {
    name: String,
    /// What it says.
    pub text: String,
}

impl Source {
    /// Reads a plan file.
    ///
    /// # Errors
    /// One that cannot be read.
    pub fn read(path: &Path) -> Result<Source> {
        let text = read_text(path).map_err(CampaignError::io("read the plan", path))?;
        Ok(Source { name: path.shown().into_owned(), text })
    }

    /// A fault at a place of the text.
    pub fn fault(&self, place: Range<usize>, message: impl Into<String>) -> CampaignError {
        let place = self.text.floor_char_boundary(place.start.min(self.text.len()));
        let line = self.text[..place].matches('\n').count() + 1;
        let begin = self.text[..place].rfind('\n').map_or(0, |at| at + 1);
        let source_line = self.text[begin..].lines().next().unwrap_or_default().trim_end();
        let (file, source_line) = (self.name.clone(), source_line.shown().into_owned());
        CampaignError::Plan { file, line, message: message.into().shown().into_owned(), source_line }
    }

    /// A fault of the plan as a whole.
    pub fn lacks(&self, message: impl Into<String>) -> CampaignError {
        CampaignError::PlanAsWhole { file: self.name.clone(), message: message.into() }
    }

    /// What it says, and the kind of campaign.
    ///
    /// # Errors
    /// What is no TOML, unknown keys and kinds (the nearest is named), keys that are of another kind, values of another
    /// type.
    pub fn plan(&self) -> Result<(PlanFile, Kind)> {
        let table = DeTable::parse(&self.text).map_err(|e| self.toml(&e))?;
        let table = table.get_ref();
        let written = table.get("kind").and_then(|kind| Some((kind.get_ref().as_str()?, kind.span())));
        let Some((name, place)) = written else {
            let kinds = KINDS.map(|(name, _)| name).join(", ");
            return Err(self.lacks(format!("no kind of campaign: write kind = \"calibrate\"; known are {kinds}")));
        };
        let Some((_, kind)) = KINDS.into_iter().find(|(known, _)| *known == name) else {
            let message = format!("unknown kind \"{name}\"; {}", hint(name, &KINDS.map(|(name, _)| name)));
            return Err(self.fault(place, message));
        };
        self.check_keys(table, "the plan", &KEYS, kind)?;
        if let Some(options) = table.get("options").and_then(|t| t.get_ref().as_table()) {
            self.check_keys(options, "[options]", &OPTIONS, kind)?;
        }
        for case in table.get("case").and_then(|t| t.get_ref().as_array()).into_iter().flatten() {
            if let Some(case) = case.get_ref().as_table() {
                self.check_keys(case, "[[case]]", &CASE, kind)?;
            }
        }
        let plan: PlanFile = toml::from_str(&self.text).map_err(|e| self.toml(&e))?;
        debug_assert_eq!(plan.kind.get_ref(), name);
        Ok((plan, kind))
    }

    fn toml(&self, error: &toml::de::Error) -> CampaignError {
        let message = error.message();
        error.span().map_or_else(|| self.lacks(message), |place| self.fault(place, message))
    }

    fn check_keys(&self, table: &DeTable, heading: &str, keys: &[Key], kind: Kind) -> Result<()> {
        let own: Vec<&str> = keys.iter().filter(|(_, kinds)| kinds.contains(&kind)).map(|(key, _)| *key).collect();
        let Some(key) = table.keys().find(|key| !own.contains(&key.get_ref().as_ref())) else { return Ok(()) };
        let name: &str = key.get_ref();
        let message = if let Some((_, kinds)) = keys.iter().find(|(key, _)| *key == name) {
            let of = KINDS.iter().filter(|(_, kind)| kinds.contains(kind)).map(|(name, _)| format!("\"{name}\""));
            format!("'{name}' is for kind = {}", of.collect::<Vec<_>>().join(" or "))
        } else if OPTIONS.iter().any(|(key, kinds)| *key == name && kinds.contains(&kind)) {
            format!("'{name}' belongs in the table [options], at the end of the plan")
        } else {
            format!("unknown key '{name}' in {heading}; {}", hint(name, &own))
        };
        Err(self.fault(key.span(), message))
    }

    /// The models of a list.
    ///
    /// # Errors
    /// No model, an effect that is none (with the line), effects that exclude each other.
    pub fn models(&self, lists: &[Spanned<Vec<String>>]) -> Result<Vec<Vec<Chosen>>> {
        let model = |list: &Spanned<Vec<String>>| {
            if list.get_ref().is_empty() {
                return Err(
                    self.fault(list.span(), "a model is a list of effects; write [\"none\"] for the base model")
                );
            }
            parse_list(&list.get_ref().join(",")).map_err(|e| self.fault(list.span(), e.to_string()))
        };
        lists.iter().map(model).collect()
    }

    /// The methods of a calibration.
    ///
    /// # Errors
    /// A method that is none.
    pub fn methods<'a>(&self, written: &'a [Spanned<String>], known: &[&str]) -> Result<Vec<&'a str>> {
        let method = |name: &'a Spanned<String>| match known.contains(&name.get_ref().as_str()) {
            true => Ok(name.get_ref().as_str()),
            false => {
                let message = format!("unknown method \"{}\"; {}", name.get_ref(), hint(name.get_ref(), known));
                Err(self.fault(name.span(), message))
            }
        };
        written.iter().map(method).collect()
    }
}

/// Names of the methods of a calibration.
pub fn methods_of_fits() -> [&'static str; 5] {
    METHODS.map(|method| method.name())
}

fn hint(name: &str, known: &[&str]) -> String {
    match nearest(name, known.iter().copied()) {
        Some(near) => format!("did you mean '{near}'?"),
        None => format!("known are {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        let source = Source { name: "plan.toml".into(), text: text.into() };
        source.plan().unwrap_err().to_string()
    }

    #[test]
    fn a_slip_is_named_with_its_line_and_the_nearest_name() {
        let cases: [(&str, &[&str]); 13] = [
            ("recordings = []", &["no kind of campaign", "calibrate"]),
            ("kind = \"callibrate\"", &["plan.toml:1", "did you mean 'calibrate'"]),
            ("kind = \"diagnose\"\n\neffect = []", &["plan.toml:3", "unknown key 'effect'", "did you mean 'effects'"]),
            (
                "kind = \"diagnose\"\nmethods = []",
                &["plan.toml:2", "'methods' is for kind = \"calibrate\" or \"sensitivity\""],
            ),
            ("kind = \"calibrate\"\nbudget = 3", &["plan.toml:2", "'budget' belongs in the table [options]"]),
            ("kind = \"calibrate\"\n[options]\nmost_reachs = 3", &["plan.toml:3", "did you mean 'most_reaches'"]),
            ("kind = \"calibrate\"\nstarts = \"3\"", &["plan.toml:2", "expected a whole number, 0 or more"]),
            ("kind = \"calibrate\"\n[options]\nrandom_starts = -1", &["plan.toml:3", "a whole number, 0 or more"]),
            ("kind = \"calibrate\"\nrecordings = \"a.mcap\"", &["plan.toml:2", "expected a list, in brackets"]),
            ("kind = \"simulate\"\nseed = 1.5", &["plan.toml:2", "expected a whole number, 0 or more"]),
            ("kind = \"simulate\"\n[set]\nx = \"a\"", &["plan.toml:3", "expected a number, or several in brackets"]),
            ("kind = \"calibrate\"\noptions = 3", &["plan.toml:2", "expected a table: [options]"]),
            (
                "kind = \"calibrate\"\n[[case]]\nrecordings = []\ntruth = \"leak\"",
                &["plan.toml:4", "is for kind = \"reliability\""],
            ),
        ];
        for (text, words) in cases {
            let said = refusal(text);
            for word in words {
                assert!(said.contains(word), "{text}: no {word:?} in {said}");
            }
        }
    }
}
