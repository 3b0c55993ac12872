//! Turntables and sweeps, as GIF files or contact sheets.

use super::report::Report;
use super::{Failure, RenderTarget, Stage};
use crate::commands::progress::Progress;
use softras_io::{Picture, PictureFormat, write_gif};
use softras_view::{Image, delay, ground, looped, moments, sheet};

/// Renders all frames once and writes them into every target.
pub fn run(stage: &mut Stage<'_>, targets: &[RenderTarget], report: &mut Report) -> Result<(), Failure> {
    let options = stage.studio.options().clone();
    let (moments, ground) = (moments(&options), ground(&options));
    let mut frames: Vec<Vec<Picture>> = targets.iter().map(|_| Vec::new()).collect();
    let progress = Progress::counted("frame", moments.len());
    for moment in &moments {
        let mut made: Vec<_> = targets.iter().map(RenderTarget::developed).collect();
        let mut depths = None;
        stage.studio.shoot(&mut stage.renderer, moment.turn, moment.step, |shot| {
            // Depth is shown between near and far, which are the same in all frames, so that greys do not flicker.
            depths = Some((shot.settings.near, shot.settings.far));
            report.add(shot);
            made.iter_mut().try_for_each(|made| made.add(shot))
        })?;
        for (made, frames) in made.into_iter().zip(&mut frames) {
            if let Image::Picture(picture, _) = made.finished(depths) {
                frames.push(picture.flattened(ground));
            }
        }
        progress.step();
    }
    drop(progress);
    report.values(moments.iter().filter_map(|m| m.step.map(|(_, value)| value)).collect());
    for (target, frames) in targets.iter().zip(frames) {
        let count = frames.len();
        match target.format {
            PictureFormat::Gif => {
                write_gif(&target.path, &looped(frames, &options.motion), delay(&options.motion, count))?
            }
            _ => {
                let labels = moments.iter().map(|m| m.label.clone());
                let cells: Vec<_> = frames.into_iter().zip(labels).collect();
                sheet(&cells, ground).save(&target.path)?;
            }
        }
        report.wrote(target, count, None);
    }
    Ok(())
}
