//! `--creep CREEP.toml`: what a creep test knows of the wall, for a calibration or a diagnosis.

use std::path::PathBuf;

use crate::cli::console::print::tell;
use crate::creep::CreepError;
use crate::creep::file::CreepFile;
use crate::creep::prior::wall_prior;
use crate::model::Model;
use crate::model::effects::Chosen;
use crate::model::prior::Prior;
use crate::shown::Shown as _;
use crate::study::Study;

/// The effect that a creep test describes.
pub(crate) const WALL: &str = "viscoelastic-wall";

/// Options of commands that fit.
#[derive(Debug, clap::Args)]
pub struct CreepPrior {
    /// Result of `surgescope creep -o`: its elements within the time scale of a surge become priors of
    /// viscoelastic-wall. Faster elements are added while the record supports them.
    #[arg(long, value_name = "CREEP.toml")]
    creep: Option<PathBuf>,
    /// Least standard deviation of a value from the creep test, which is slower and at larger strains than a surge.
    #[arg(long, value_name = "PERCENT", default_value_t = 10.0, value_parser = crate::cli::args::values::positive, requires = "creep",
          allow_negative_numbers = true)]
    creep_sd: f64,
}

impl CreepPrior {
    /// Whether there is a creep test.
    pub fn given(&self) -> bool {
        self.creep.is_some()
    }

    /// What the test knows of a model's parameters, nothing where there is none; gives the model's wall its number of
    /// elements, unless the surge may show faster ones than the test.
    ///
    /// # Errors
    /// A file that cannot be read, a model without a wall that creeps or with fewer elements than the test shows.
    pub fn priors(
        &self,
        study: &Study,
        effects: &mut [Chosen],
    ) -> Result<Vec<Prior>, Box<dyn std::error::Error + Send + Sync>> {
        let Some(path) = &self.creep else { return Ok(Vec::new()) };
        let (rig, run, loaded) = (study.rig(), &study.runs()[0], study.recordings());
        let text = crate::text_file::read_text(path)
            .map_err(|e| crate::storage::output::unread("the creep test in", path, &e))?;
        let file = CreepFile::parse(&text, &path.shown())?;
        let wall = effects.iter_mut().find(|c| c.effect.name() == WALL).ok_or(CreepError::NoWall)?;
        let base = Model::new(rig, &run.conditions.water, &[]);
        let starts: Vec<f64> =
            base.shared.iter().map(|p| p.start * run.start.wave_speed_ratio.unwrap_or(1.0)).collect();
        let most = wall.effect.elements().map_or(1, |range| *range.end());
        let water_degc = loaded.iter().map(|l| l.features.temperature_degc).sum::<f64>() / loaded.len() as f64;
        let known = wall_prior(&file, base.period_s(&starts), water_degc, 0.01 * self.creep_sd, most)?;
        if let Some(asked) = wall.elements.filter(|&n| n < known.elements) {
            return Err(CreepError::TooFew { asked, found: known.elements }.into());
        }
        // Where the test shows all that the surge does, its number is the model's.
        if !known.faster && wall.elements.is_none() {
            *wall = wall.with_elements(known.elements);
        }
        for sentence in known.sentences.iter().chain(&rig.constraint_in_words()) {
            tell!("{sentence}");
        }
        Ok(known.priors)
    }
}
