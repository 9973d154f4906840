//! From a plan file to a folder of tasks: each combination of recordings or rig, model, method and seed is one.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use toml::Spanned;

use crate::campaign::checksum::checksum;
use crate::campaign::error::{CampaignError, Result, sentence};
use crate::campaign::folder::Folder;
use crate::campaign::marks::{self, Mark};
use crate::campaign::perform::check;
use crate::campaign::plan_file::{Count, Kind, PlanFile, Source, Values, methods_of_fits};
use crate::campaign::task::{FitOptions, Input, Task, Work};
use crate::fit::problem::method::Method;
use crate::model::effects::{CATALOGUE, Chosen};
use crate::rig::{Rig, own_effects};
use crate::shown::Shown as _;
use crate::storage::nearest::nearest;
use crate::storage::output;
use crate::storage::read::read_own_effects;

/// What a plan has become.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Planned {
    /// Tasks.
    pub tasks: usize,
    /// Combinations that were another one over again.
    pub doubles: usize,
    /// It had been planned before, just so.
    pub was_there: bool,
}

/// First bytes of a recording.
const RECORDING: &[u8] = b"\x89MCAP0\r\n";

/// Plans a campaign in a new folder; with `copy`, its inputs go there too. The same plan may be planned again.
///
/// # Errors
/// A plan with a fault (its line is named), inputs that cannot be read, a folder that holds something else.
pub fn plan(file: &Path, root: &Path, copy: bool) -> Result<Planned> {
    let source = Source::read(file)?;
    let (written, kind) = source.plan()?;
    let base = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut planner = Planner { source: &source, plan: &written, base, inputs: HashMap::new(), tasks: Vec::new() };
    match kind {
        Kind::Calibrate | Kind::Diagnose | Kind::Reliability => planner.of_recordings(kind)?,
        Kind::Simulate => planner.simulations()?,
        Kind::Sensitivity => planner.designs()?,
    }
    let mut tasks = planner.tasks;
    if copy {
        tasks.iter_mut().for_each(|task| task.recordings.iter_mut().chain(&mut task.rig).for_each(place_copy));
    }
    let all = tasks.len();
    tasks.sort_by(|a, b| a.task.cmp(&b.task));
    tasks.dedup_by(|a, b| a.task == b.task);
    let mut text = String::new();
    for task in &tasks {
        text += &serde_json::to_string(task).map_err(|e| source.lacks(e.to_string()))?;
        text.push('\n');
    }
    let folder = Folder::at(root);
    let was_there = folder.tasks_file().exists();
    if was_there {
        let old = fs::read(folder.tasks_file()).map_err(CampaignError::io("read", &folder.tasks_file()))?;
        if old != text.as_bytes() {
            let finished = folder.marks_to_read()?.all().map_err(CampaignError::io("read", &folder.place("marks")))?;
            let finished = finished.iter().filter(|mark| **mark != Mark::Missing).count();
            return Err(CampaignError::OtherPlan { folder: root.to_owned(), tasks: folder.count()?, finished });
        }
    } else {
        lay_out(&folder, &source, &text, tasks.len(), copy.then_some(&planner.inputs))?;
    }
    Ok(Planned { tasks: tasks.len(), doubles: all - tasks.len(), was_there })
}

/// Writes the folder; the tasks come last, for where they are, all is.
fn lay_out(
    folder: &Folder,
    source: &Source,
    tasks: &str,
    count: usize,
    copied: Option<&HashMap<PathBuf, Input>>,
) -> Result<()> {
    let root = folder.root();
    fs::create_dir_all(root).map_err(CampaignError::unwritten(root))?;
    let mut inside = fs::read_dir(root).map_err(CampaignError::io("list", root))?;
    // what a planning that was interrupted has left may be written again
    let ours = |name: &str| ["plan.toml", "marks", "inputs"].contains(&name) || name.starts_with(".surgescope-");
    if inside.any(|entry| entry.is_ok_and(|e| !e.file_name().to_str().is_some_and(ours))) {
        return Err(CampaignError::NotEmpty(root.to_owned()));
    }
    for input in copied.into_iter().flat_map(HashMap::values) {
        let mut copy = input.clone();
        place_copy(&mut copy);
        let files = [(input, &copy)].into_iter().chain(input.effects.iter().zip(&copy.effects));
        for (from, to) in files.map(|(from, to)| (&from.path, root.join(&to.path))) {
            let parent = to.parent().unwrap_or(root);
            fs::create_dir_all(parent).map_err(CampaignError::unwritten(parent))?;
            fs::copy(from, &to).map_err(CampaignError::unwritten(&to))?;
        }
    }
    let write = |path: &Path, text: &str| {
        output::write_with(path, |out| out.write_all(text.as_bytes())).map_err(CampaignError::not_whole(path))
    };
    write(&folder.place("plan.toml"), &source.text)?;
    marks::write(&folder.place("marks"), &vec![Mark::Missing; count])?;
    write(&folder.tasks_file(), tasks)
}

/// Where the copies of an input and of the effects beside it are: under its checksum, with its own name, by which
/// results call it.
fn place_copy(input: &mut Input) {
    let folder = Path::new("inputs").join(&input.identity()[..16]);
    let placed = |path: &Path, folder: &Path| folder.join(path.file_name().unwrap_or_default());
    input.path = placed(&input.path, &folder);
    for effect in &mut input.effects {
        effect.path = placed(&effect.path, &folder.join(own_effects::FOLDER));
    }
}

struct Planner<'a> {
    source: &'a Source,
    plan: &'a PlanFile,
    /// The folder of the plan file.
    base: &'a Path,
    /// What was read already, by its path.
    inputs: HashMap<PathBuf, Input>,
    tasks: Vec<Task>,
}

/// Recordings that are used together, their models, and what is hidden in them.
struct Group {
    name: String,
    recordings: Vec<Input>,
    models: Vec<Vec<Chosen>>,
    truth: Option<String>,
}

impl Planner<'_> {
    fn of_recordings(&mut self, kind: Kind) -> Result<()> {
        let (plan, source) = (self.plan, self.source);
        let rig = plan.rig.as_ref().map(|rig| self.one(rig)).transpose()?;
        let groups = self.groups(kind)?;
        let options = &plan.options;
        if options.misfit.get_ref() != "time" && options.misfit.get_ref() != "frequency" {
            return Err(source.fault(options.misfit.span(), "misfit must be \"time\" or \"frequency\""));
        }
        let most_reaches = options.most_reaches.get_ref().get();
        if !(8..=100_000).contains(&most_reaches) {
            return Err(source.fault(options.most_reaches.span(), "most_reaches must be from 8 to 100000"));
        }
        let fit = FitOptions {
            // a seed without a start that is drawn from it would do the same again
            random_starts: options.random_starts.map_or(usize::from(plan.starts.is_some()), Count::get),
            most_reaches,
            hold: options.hold.iter().map(|(name, v)| Ok((name.clone(), self.held(v)?))).collect::<Result<_>>()?,
            ignore: options.ignore.clone(),
        };
        let mut methods = source.methods(&plan.methods, &methods_of_fits())?;
        if methods.is_empty() {
            methods.push(Method::LeastSquares.name());
        }
        let seeds = self.seeds()?;
        let of_descent: &[Option<u64>] = if fit.random_starts > 0 { &seeds } else { &[None] };
        for Group { name, recordings, models, truth } in groups {
            for effects in &models {
                let mut add = |work| self.add(&name, recordings.clone(), rig.clone(), effects, work);
                match kind {
                    Kind::Calibrate => {
                        for method in &methods {
                            let misfit = options.misfit.get_ref().clone();
                            let (seeds, fit) = match *method {
                                "least-squares" => (of_descent, fit.clone()),
                                "stepwise" => (&[None][..], FitOptions { random_starts: 0, ..fit.clone() }),
                                _ => (&seeds[..], FitOptions { random_starts: 0, ..fit.clone() }),
                            };
                            let budget = options.budget.get();
                            for &seed in seeds {
                                let (method, misfit, fit) = ((*method).to_owned(), misfit.clone(), fit.clone());
                                add(Work::Calibrate { method, seed, budget, misfit, fit })?;
                            }
                        }
                    }
                    Kind::Reliability => {
                        for &seed in of_descent {
                            let truth = truth.clone().unwrap_or_default();
                            add(Work::Reliability { truth, seed, fit: fit.clone() })?;
                        }
                    }
                    _ => {
                        for &seed in of_descent {
                            add(Work::Diagnose { seed, fit: fit.clone() })?;
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn groups(&mut self, kind: Kind) -> Result<Vec<Group>> {
        let (plan, source) = (self.plan, self.source);
        let singles = self.all_matched(&plan.recordings)?;
        let cases = plan.case.iter().map(|case| self.all_matched(&case.get_ref().recordings));
        let cases = cases.collect::<Result<Vec<_>>>()?;
        let models = self.models(&plan.effects)?;
        let truth = plan.truth.as_ref().map(|t| self.truth(t)).transpose()?;
        let mut groups = Vec::new();
        for recording in singles {
            let (name, truth) = (recording.name.clone(), truth.clone());
            groups.push(Group { name, recordings: vec![recording], models: models.clone(), truth });
        }
        for (written, recordings) in plan.case.iter().zip(cases) {
            let case = written.get_ref();
            let Some(first) = recordings.first() else {
                return Err(source.fault(written.span(), "a case needs recordings"));
            };
            let own = self.models(&case.effects)?;
            groups.push(Group {
                name: case.name.clone().unwrap_or_else(|| first.name.clone()),
                models: if own.is_empty() { models.clone() } else { own },
                truth: case.truth.as_ref().map(|t| self.truth(t)).transpose()?.or_else(|| truth.clone()),
                recordings,
            });
        }
        if groups.is_empty() {
            return Err(source.lacks("no recordings: write recordings = [\"runs/*.mcap\"]"));
        }
        if let Some(group) = groups.iter().find(|group| group.models.is_empty()) {
            return Err(source.lacks(format!(
                "no model for {}: write effects = [[\"none\"], [\"viscoelastic-wall:2\"]]",
                group.name
            )));
        }
        if let (Kind::Reliability, Some(group)) = (kind, groups.iter().find(|group| group.truth.is_none())) {
            return Err(source.lacks(format!(
                "nothing says what is hidden in {}: write truth = \"leak\", or \"nothing\", in the plan or in its [[case]]",
                group.name
            )));
        }
        Ok(groups)
    }

    /// Models with effects of the catalogue, or of the inputs' own: these are read until all names are known.
    fn models(&self, lists: &[Spanned<Vec<String>>]) -> Result<Vec<Vec<Chosen>>> {
        let mut models = self.source.models(lists);
        for path in self.inputs.keys() {
            if models.is_ok() {
                break;
            }
            read_own_effects(path).map_err(|e| self.source.lacks(sentence(&e)))?;
            models = self.source.models(lists);
        }
        models
    }

    /// An effect of the catalogue, `nothing`, or `unknown` for one that is not in it.
    fn truth(&self, written: &Spanned<String>) -> Result<String> {
        let name = written.get_ref().as_str();
        let known = CATALOGUE.iter().map(|effect| effect.name()).chain(["nothing", "unknown"]);
        if known.clone().any(|k| k == name) {
            return Ok(name.to_owned());
        }
        let hint = nearest(name, known).map(|near| format!("; did you mean '{near}'?")).unwrap_or_default();
        let message = format!("truth is an effect of the catalogue, \"nothing\", or \"unknown\", not \"{name}\"{hint}");
        Err(self.source.fault(written.span(), message))
    }

    fn held(&self, values: &Spanned<Values>) -> Result<[f64; 2]> {
        match values.get_ref() {
            Values::One(value) => Ok([*value; 2]),
            Values::Several(range) => match range[..] {
                [lower, upper] if lower <= upper => Ok([lower, upper]),
                _ => Err(self.source.fault(values.span(), "write a number, or [LEAST, MOST]")),
            },
        }
    }

    fn seeds(&self) -> Result<Vec<Option<u64>>> {
        let count = match &self.plan.starts {
            None => 1,
            Some(starts) if starts.get_ref().get() == 0 => {
                return Err(self
                    .source
                    .fault(starts.span(), "starts must be at least 1: so many seeds a combination has"));
            }
            Some(starts) => u64::from(starts.get_ref().get()),
        };
        Ok((0..count).map(|k| Some(self.plan.seed.get().wrapping_add(k))).collect())
    }

    /// Rigs with their models; without `effects`, the base model.
    fn rigs(&mut self) -> Result<(Vec<Input>, Vec<Vec<Chosen>>)> {
        let (plan, source) = (self.plan, self.source);
        let mut rigs = Vec::new();
        for pattern in &plan.rigs {
            rigs.extend(self.matched(pattern, false)?);
        }
        if rigs.is_empty() {
            return Err(source.lacks("no rigs: write rigs = [\"rigs/*.toml\"]"));
        }
        let mut models = self.models(&plan.effects)?;
        if models.is_empty() {
            models.push(Vec::new());
        }
        Ok((rigs, models))
    }

    fn ranges(&self) -> Result<BTreeMap<String, [f64; 2]>> {
        let checked = |(name, range): (&String, &Spanned<[f64; 2]>)| match *range.get_ref() {
            [low, high] if low < high && low.is_finite() && high.is_finite() => Ok((name.clone(), [low, high])),
            _ => Err(self
                .source
                .fault(range.span(), format!("the range of {name} must be [LOW, HIGH] with LOW below HIGH"))),
        };
        self.plan.range.iter().map(checked).collect()
    }

    /// Every combination of the values in `[set]`, with what is drawn from `[range]`.
    fn simulations(&mut self) -> Result<()> {
        let (rigs, models) = self.rigs()?;
        let (range, seeds) = (self.ranges()?, self.seeds()?);
        if let (true, Some(starts)) = (range.is_empty(), &self.plan.starts) {
            return Err(self
                .source
                .fault(starts.span(), "nothing is drawn: add [range] NAME = [LOW, HIGH], or leave starts out"));
        }
        let mut grid = vec![BTreeMap::new()];
        for (name, values) in &self.plan.set {
            if range.contains_key(name) {
                return Err(self
                    .source
                    .fault(values.span(), format!("{name} stands in [set] and in [range]: take one out")));
            }
            let values = match values.get_ref() {
                Values::One(value) => vec![*value],
                Values::Several(values) => values.clone(),
            };
            let with = |set: BTreeMap<String, f64>| {
                let one = move |value: &f64| {
                    set.iter().map(|(n, v)| (n.clone(), *v)).chain([(name.clone(), *value)]).collect()
                };
                values.iter().map(one).collect::<Vec<BTreeMap<_, _>>>()
            };
            grid = grid.into_iter().flat_map(with).collect();
        }
        for rig in &rigs {
            let loaded = self.loaded(rig)?;
            for effects in &models {
                for set in &grid {
                    for seed in seeds.iter().flatten() {
                        let mut random = fastrand::Rng::with_seed(*seed);
                        let mut set = set.clone();
                        set.extend(
                            range.iter().map(|(name, [low, high])| (name.clone(), low + (high - low) * random.f64())),
                        );
                        let work = Work::Simulate { set };
                        self.check(rig, &loaded, effects, &work)?;
                        self.add(&rig.name, Vec::new(), Some(rig.clone()), effects, work)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn designs(&mut self) -> Result<()> {
        let (rigs, models) = self.rigs()?;
        let (plan, source) = (self.plan, self.source);
        let (range, seeds, options) = (self.ranges()?, self.seeds()?, &plan.options);
        let mut methods = source.methods(&plan.methods, &["morris", "sobol"])?;
        if methods.is_empty() {
            methods.push("morris");
        }
        let mut set = BTreeMap::new();
        for (name, values) in &plan.set {
            match values.get_ref() {
                Values::One(value) => drop(set.insert(name.clone(), *value)),
                Values::Several(_) => {
                    return Err(source.fault(values.span(), format!("{name} must be one number here")));
                }
            }
        }
        if let Some(within) =
            options.within.as_ref().filter(|factor| factor.get_ref().is_nan() || *factor.get_ref() <= 1.0)
        {
            return Err(source.fault(within.span(), "within must be a factor above 1"));
        }
        for rig in &rigs {
            let loaded = self.loaded(rig)?;
            for effects in &models {
                for &method in &methods {
                    for &seed in seeds.iter().flatten() {
                        let work = Work::Sensitivity {
                            method: method.to_owned(),
                            seed,
                            set: set.clone(),
                            range: range.clone(),
                            only: plan.only.clone(),
                            within: options.within.as_ref().map(|factor| *factor.get_ref()),
                            sensor: options.sensor.clone(),
                            size: if method == "morris" { options.trajectories } else { options.rows }.get(),
                        };
                        self.check(rig, &loaded, effects, &work)?;
                        self.add(&rig.name, Vec::new(), Some(rig.clone()), effects, work)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn loaded(&self, rig: &Input) -> Result<Rig> {
        Rig::load(&rig.path).map_err(|e| self.source.lacks(format!("{}: {}", rig.name, sentence(&e))))
    }

    /// Whether the model of a rig has these settings, and can take their values: a slip would fail the task.
    fn check(&self, rig: &Input, loaded: &Rig, effects: &[Chosen], work: &Work) -> Result<()> {
        check(loaded, effects, work).map_err(|e| self.source.lacks(format!("{}: {}", rig.name, sentence(e.as_ref()))))
    }

    fn add(
        &mut self,
        case: &str,
        recordings: Vec<Input>,
        rig: Option<Input>,
        effects: &[Chosen],
        work: Work,
    ) -> Result<()> {
        let effects = effects.iter().map(Chosen::label).collect();
        let task = Task::new(case.to_owned(), recordings, rig, effects, work);
        self.tasks.push(task.map_err(|e| self.source.lacks(e.to_string()))?);
        Ok(())
    }

    /// The one file that a key names.
    fn one(&mut self, written: &Spanned<String>) -> Result<Input> {
        self.input(&self.base.join(written.get_ref()), written, false)
    }

    /// The recordings that the patterns match, in the order of the patterns.
    fn all_matched(&mut self, patterns: &[Spanned<String>]) -> Result<Vec<Input>> {
        let found = patterns.iter().map(|pattern| self.matched(pattern, true)).collect::<Result<Vec<_>>>()?;
        Ok(found.concat())
    }

    /// The files that a pattern matches, sorted by name; never none.
    fn matched(&mut self, pattern: &Spanned<String>, recordings: bool) -> Result<Vec<Input>> {
        let fault = |message: String| self.source.fault(pattern.span(), message);
        // the folder's own name is no pattern
        let base = glob::Pattern::escape(&self.base.to_string_lossy());
        let whole = Path::new(&base).join(pattern.get_ref());
        let found =
            glob::glob(&whole.to_string_lossy()).map_err(|e| fault(format!("this is no pattern: {}", e.msg)))?;
        let paths = found.collect::<std::result::Result<Vec<_>, _>>().map_err(|e| fault(e.to_string()))?;
        let mut inputs = Vec::new();
        for path in paths.iter().filter(|path| !path.is_dir()) {
            inputs.push(self.input(path, pattern, recordings)?);
        }
        if inputs.is_empty() {
            let base = self.base.canonicalize().unwrap_or_else(|_| self.base.to_owned());
            return Err(fault(format!("no file matches \"{}\" (from {})", pattern.get_ref(), base.display())));
        }
        Ok(inputs)
    }

    fn input(&mut self, path: &Path, written: &Spanned<String>, recording: bool) -> Result<Input> {
        if let Some(known) = self.inputs.get(path) {
            return Ok(known.clone());
        }
        let fault = |message: String| self.source.fault(written.span(), message);
        let unread = |e: std::io::Error| fault(format!("{} cannot be read: {e}", path.shown()));
        if recording {
            let mut start = Vec::new();
            fs::File::open(path).and_then(|f| f.take(8).read_to_end(&mut start)).map_err(unread)?;
            if start != RECORDING {
                let what = "is no recording (MCAP): `surgescope import` makes one of a table";
                return Err(fault(format!("{} {what}", path.shown())));
            }
        }
        let mut input = self.hashed(path).map_err(fault)?;
        let folder = input.path.parent().unwrap_or(Path::new("/"));
        let files = own_effects::files_beside(folder).map_err(|e| fault(sentence(&e)))?;
        input.effects = files.iter().map(|file| self.hashed(file).map_err(fault)).collect::<Result<_>>()?;
        self.inputs.insert(path.to_owned(), input.clone());
        Ok(input)
    }

    /// A file as it is now, or what is wrong with it.
    fn hashed(&self, path: &Path) -> std::result::Result<Input, String> {
        let unread = |e: std::io::Error| format!("{} cannot be read: {e}", path.shown());
        let sha256 = checksum(path).map_err(unread)?;
        let name = path.strip_prefix(self.base).unwrap_or(path).to_str();
        let absolute = path.canonicalize().map_err(unread)?;
        let (Some(name), Some(_)) = (name, absolute.to_str()) else {
            return Err(format!("{}: the name is no text in UTF-8; rename the file", path.shown()));
        };
        Ok(Input { name: name.to_owned(), path: absolute, sha256, effects: Vec::new() })
    }
}
