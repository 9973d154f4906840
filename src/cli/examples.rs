//! Two examples for the end of each command's help. They use the rigs and recordings that the project ships; where they
//! need another file, the help has the commands that make it. A test runs them all as they stand.

use clap::Command;

/// A command, as one types it, and the arguments of its examples.
const EXAMPLES: &[(&str, [&str; 2])] = &[
    ("accept", ["surgescope-demo/demo.mcap", "surgescope-demo/demo.mcap --json"]),
    ("add", ["unsteady-friction model.toml", "sensor-lag@P2 model.toml"]),
    (
        "calibrate",
        [
            "recordings/hdpe-creep.mcap --effects viscoelastic-wall:2 --save model.toml --report run.html",
            "recordings/hdpe-creep.mcap --hold closing_time_s=0.3 -o fit.toml",
        ],
    ),
    ("campaign", ["plan recordings/plan.toml -o study", "run study --threads 2"]),
    ("campaign plan", ["recordings/plan.toml -o study", "recordings/plan.toml -o on-a-cluster --json"]),
    ("campaign run", ["study --shard 1/2", "study --shard 2/2"]),
    ("campaign submit", ["study --to hq", "study --to slurm"]),
    ("campaign status", ["study", "study --json"]),
    (
        "creep",
        [
            "recordings/creep/hdpe-25degC.csv -o creep.toml",
            "recordings/creep/hdpe-15degC.csv recordings/creep/hdpe-25degC.csv --temperature-degC 15,25 --report creep.html",
        ],
    ),
    ("completions", ["bash", "zsh"]),
    (
        "cross-validate",
        [
            "recordings/hdpe-creep.mcap --effects viscoelastic-wall:2 --by time",
            "recordings/hdpe-creep.mcap --effects viscoelastic-wall:1 --against none --by sensors",
        ],
    ),
    ("demo", ["", "--hidden blockage -o my-demo --speed 20"]),
    (
        "diagnose",
        [
            "recordings/hdpe-nothing-missing.mcap --effects viscoelastic-wall --report diagnosis.html",
            "recordings/hdpe-creep.mcap --effects viscoelastic-wall --apply grown.toml",
        ],
    ),
    ("effects", ["", "leak --svg leak.svg"]),
    ("effects new", ["relief-valve", "relief-valve -o my-rig/effects/relief-valve.toml"]),
    (
        "effects check",
        ["effects/relief-valve.toml", "effects/relief-valve.toml --rig rigs/demo-hdpe.toml --svg relief.svg"],
    ),
    ("explain", ["model.toml", "recordings/hdpe-nothing-missing.mcap --effects viscoelastic-wall"]),
    ("export", ["recordings/hdpe-creep.mcap -o creep.csv", "recordings/copper-leak.mcap -o leak.csv"]),
    (
        "family",
        [
            "cold.mcap warm.mcap --effects viscoelastic-wall:1 --report family.html",
            "cold.mcap warm.mcap --effects viscoelastic-wall:1 --apart --csv family.csv",
        ],
    ),
    (
        "frequency",
        ["recordings/copper-leak.mcap", "recordings/hdpe-creep.mcap --model model.toml --report frequency.html"],
    ),
    ("help", ["calibrate", "diagnosis"]),
    ("history", ["--folder surgescope-demo", "--folder surgescope-demo --csv history.csv --report history.html"]),
    (
        "import",
        [
            "creep.csv --rig rigs/demo-hdpe.toml -o imported.mcap",
            "creep.csv --rig rigs/demo-hdpe.toml --without P1 -o imported-without.mcap",
        ],
    ),
    ("inspect", ["recordings/copper-leak.mcap", "recordings/hdpe-creep.mcap --ignore P2 --json"]),
    (
        "layout",
        ["--rig rigs/demo-hdpe.toml -o foxglove.json", "--rig rigs/demo-hdpe.toml --with-model -o plotjuggler.xml"],
    ),
    ("man", ["man1", "man1 --overwrite"]),
    ("model", ["model.toml", "model.toml --json"]),
    ("next", ["model.toml --for wave_speed_m_s --save test.toml", "model.toml --for tau1_s --report next.html"]),
    ("open", ["recordings/hdpe-creep.mcap", "surgescope-demo --no-browser"]),
    (
        "pest",
        [
            "recordings/hdpe-creep.mcap --effects viscoelastic-wall:1 -o pest",
            "recordings/hdpe-creep.mcap --effects viscoelastic-wall:1 --fitted -o pest-fitted",
        ],
    ),
    ("ports", ["", "--json"]),
    (
        "predict",
        ["model.toml recordings/hdpe-creep.mcap", "model.toml recordings/hdpe-creep.mcap --report prediction.html"],
    ),
    (
        "record",
        [
            "--rig rigs/demo-hdpe.toml --simulate --duration 2 -o test.mcap",
            "--replay recordings/hdpe-creep.mcap --speed 0 --note ambient=12degC -o again.mcap",
        ],
    ),
    ("recover", ["recordings/hdpe-creep.mcap -o whole.mcap", "recordings"]),
    ("refit", ["model.toml", "model.toml --json"]),
    ("replay", ["recordings/hdpe-creep.mcap", "recordings/adelaide --verbose"]),
    ("results", ["fit.toml -o results.csv", "fit.toml --long -o values.csv"]),
    ("rig", ["check rigs/demo-hdpe.toml", "check rigs/demo-hdpe.toml recordings/hdpe-creep.mcap"]),
    (
        "rig new",
        [
            "--material HDPE --length-m 150 --pipe 63SDR11 --sensor P1=150 --sensor P2=75 --yes -o mine.toml",
            "recordings/logger.csv --material copper --length-m 100 --pipe 22x1.5 --yes -o logger.toml",
        ],
    ),
    ("rig show", ["rigs/demo-hdpe.toml", "rigs/adelaide-copper.toml --svg rig.svg"]),
    ("rig check", ["rigs/demo-hdpe.toml", "rigs/demo-hdpe.toml recordings/hdpe-creep.mcap"]),
    (
        "sensitivity",
        [
            "rigs/demo-hdpe.toml --within 2 --method morris --trajectories 5",
            "rigs/demo-hdpe.toml --model model.toml --within 1.5 --only wave_speed_m_s,closing_time_s --method sobol --rows 32",
        ],
    ),
    (
        "simulate",
        [
            "--rig rigs/demo-hdpe.toml -o simulated.csv",
            "--rig rigs/demo-hdpe.toml --effects leak --set leak_position_m=60 --seed 1 -o hidden.mcap",
        ],
    ),
    ("undo", ["model.toml", "model.toml --json"]),
    (
        "valve",
        ["recordings/copper-leak.mcap", "recordings/hdpe-creep.mcap --effects viscoelastic-wall:2 --svg valve.svg"],
    ),
    ("watch", ["surgescope-demo --once", "surgescope-demo --once --accept never --json-lines"]),
];

const MODEL: &str = "calibrate recordings/hdpe-creep.mcap --effects viscoelastic-wall:2 --save model.toml";

const PLAN: &str = "campaign plan recordings/plan.toml -o study";

/// What the examples of a command need, and the commands that make it.
const NEEDS: &[(&str, &[&str])] = &[
    ("accept", &["demo", "watch surgescope-demo --once"]),
    ("add", &[MODEL]),
    ("campaign run", &[PLAN]),
    ("campaign submit", &[PLAN]),
    ("effects check", &["effects new relief-valve"]),
    ("campaign status", &[PLAN, "campaign run study"]),
    (
        "family",
        &[
            "rig new --name pipe --material HDPE --length-m 100 --pipe 63SDR11 --temperature-degC 15 --yes -o cold.toml",
            "simulate --rig cold.toml --effects viscoelastic-wall:1 --set J1_per_GPa=0.12 tau1_s=0.181 -o cold.mcap",
            "rig new --name pipe --material HDPE --length-m 100 --pipe 63SDR11 --temperature-degC 30 --yes -o warm.toml",
            "simulate --rig warm.toml --effects viscoelastic-wall:1 --set J1_per_GPa=0.12 tau1_s=0.0525 -o warm.mcap",
        ],
    ),
    ("explain", &[MODEL]),
    ("frequency", &[MODEL]),
    ("history", &["demo", "watch surgescope-demo --once"]),
    ("import", &["export recordings/hdpe-creep.mcap -o creep.csv"]),
    ("model", &[MODEL]),
    ("next", &[MODEL]),
    ("open", &["demo"]),
    ("predict", &[MODEL]),
    ("refit", &[MODEL]),
    ("results", &["calibrate recordings/hdpe-creep.mcap -o fit.toml"]),
    ("sensitivity", &[MODEL]),
    ("undo", &[MODEL, "add unsteady-friction model.toml", "add sensor-lag@P2 model.toml"]),
    ("watch", &["demo"]),
];

/// The commands with their examples at the end of their help.
pub(crate) fn added(command: Command) -> Command {
    below(command, "")
}

fn below(command: Command, path: &str) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|c| c.get_name().to_owned()).collect();
    names.iter().fold(command, |command, name| {
        let path = format!("{path} {name}").trim_start().to_owned();
        command.mut_subcommand(name, |c| {
            let c = below(c, &path);
            match EXAMPLES.iter().find(|(of, _)| *of == path) {
                Some((_, examples)) => {
                    let line = |words: &str| format!("\n  surgescope {words}").trim_end().to_owned();
                    let lines = examples.map(|e| line(&format!("{path} {e}")));
                    let needs = NEEDS.iter().filter(|(of, _)| *of == path).flat_map(|(_, needs)| *needs);
                    let first: String = needs.map(|words| line(words)).collect();
                    let first = if first.is_empty() { first } else { format!("First:{first}\n") };
                    c.after_help(format!("{first}Examples:{}", lines.concat()))
                }
                None => c,
            }
        })
    })
}
