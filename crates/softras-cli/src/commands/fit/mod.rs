//! `softras fit`: fits a mesh to images.

pub mod args;
mod plot;
mod report;

use super::outputs::Outputs;
use super::progress::Progress;
use super::{Failure, note};
use args::FitArgs;
use softras::{Mesh, Renderer, scene::Appearance};
use softras_fit::{Event, Film, Fit, Fitting, Painted, Subject, Template};
use softras_io::{Budget, Loaded, Map, SaveOptions, Views, output};
use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

const CHECKPOINT_STEPS: usize = 100;

pub fn run(args: &FitArgs) -> Result<(), Failure> {
    let (files, out) = (&args.files, &args.out);
    args.check()?;
    let written = [&files.report, &files.json, &files.plot, &files.gif, &files.checkpoint, &files.save_cameras];
    let views = view_files(args)?;
    let outputs = Outputs::new(written.into_iter().flatten().chain(&views), [out])?;
    let mut renderer = super::open_device(args.device.as_deref(), args.read.memory)?;
    let budget = Budget::new(args.read.memory);
    let from = args.from.as_ref().map(|path| args.read.read(path, true, &outputs, &budget)).transpose()?;
    let origin = from.as_ref().map_or([0.0; 3], |from| from.origin);
    let save = |mesh: &Mesh| softras_io::save_with(mesh, out, &SaveOptions { origin, ..SaveOptions::default() });
    let template = template(args, &outputs, &budget, &renderer, origin)?;
    let subject = subject(args, from, &outputs, &budget, &mut renderer)?;
    let stop = super::interrupted()?;
    let told = Progress::spinner("views");
    let begun =
        Fit { subject, options: args.options(template) }.begin(&mut renderer, &mut |event| tell(&told, event, stop));
    drop(told);
    let mut fitting = match begun {
        Err(_) if stop.load(Ordering::Relaxed) => {
            note("interrupted before the first step: no mesh is written");
            return Err(Failure::Interrupted);
        }
        begun => begun?,
    };
    if let Some(path) = files.checkpoint.as_ref().filter(|path| files.resume && path.exists()) {
        let step = fitting.resume(path, Budget::new(args.read.memory))?;
        note(&format!("going on from step {step} of {}", path.display()));
    }
    let mut film = files.gif.is_some().then(|| Film::new(&fitting)).transpose()?;
    let painted = match work(args, &mut fitting, &mut film, &mut renderer, stop) {
        Ok(painted) => painted,
        Err(failure) => {
            // The best mesh found before the error is still written.
            if let Some((best, step)) = fitting.best() {
                save(best)?;
                note(&format!("{} is the best mesh before the error, of step {step}", out.display()));
            }
            return Err(failure);
        }
    };
    if let Some(path) = &files.save_cameras {
        fitting.views().save_cameras(path)?;
    }
    if stop.load(Ordering::Relaxed)
        && let Some((best, _)) = fitting.best()
    {
        // A second Ctrl-C ends the process at once, while the mesh is judged.
        save(best)?;
    }
    let told = Progress::spinner("scores");
    let fitted = fitting.finish(painted, &mut renderer, &mut |event| tell(&told, event, stop))?;
    drop(told);
    save(&fitted.mesh)?;
    if let (Some(path), Some(film)) = (&files.gif, film) {
        film.write(path)?;
    }
    if let Some(path) = &files.plot {
        plot::write(path, &fitted.losses())?;
    }
    if let Some(path) = &files.report {
        let page = fitted.report(&format!("{}, fitted", out.display()), &mut renderer)?;
        output::write_file(path, page.as_bytes())?;
    }
    if let Some(path) = &files.json {
        let report = report::json(args, &fitted, renderer.device_name());
        output::write_file(path, report.to_string().as_bytes())?;
    }
    report::tell(out, &fitted, ["auto", "hull"].contains(&&args.template[..]))?;
    if fitted.is_complete { Ok(()) } else { Err(Failure::Interrupted) }
}

/// The files of the views that are written, whose folders are made.
fn view_files(args: &FitArgs) -> Result<Vec<PathBuf>, Failure> {
    let Some(folder) = &args.files.write_views else { return Ok(Vec::new()) };
    let maps: Vec<Map> = args.targets.also.iter().map(|&map| map.into()).collect();
    if let Some(from) = &args.from {
        // No folder is made for a mesh that is not there.
        softras_io::built_in(from)?;
    }
    for folder in [folder.clone()].into_iter().chain(maps.iter().map(|map| folder.join(map.folder()))) {
        std::fs::create_dir_all(&folder).map_err(|source| softras::Error::Io { path: folder, source })?;
    }
    Ok(Views::files(folder, args.count_of_views()?, &maps))
}

/// The mesh to begin with, relative to the origin of what is fitted. None of the files read may be one that will be written.
fn template(
    args: &FitArgs,
    outputs: &Outputs,
    budget: &Budget,
    renderer: &Renderer,
    origin: [f64; 3],
) -> Result<Template, Failure> {
    Ok(match args.template.as_str() {
        "auto" => Template::Auto,
        "sphere" => Template::Sphere,
        "hull" => Template::Hull,
        path => {
            let other = |error| Failure::Usage(format!("--template {error}; or auto, hull or sphere"));
            softras_io::built_in(path).map_err(other)?;
            let loaded = args.read.read(Path::new(path), true, outputs, budget)?;
            let mesh = super::held(args.read.placed(loaded, origin)?.mesh, renderer)?;
            args.check_template(&mesh)?;
            Template::Mesh(Box::new(mesh))
        }
    })
}

/// Reads or renders the views that the arguments ask for.
fn subject(
    args: &FitArgs,
    from: Option<Loaded>,
    outputs: &Outputs,
    budget: &Budget,
    renderer: &mut Renderer,
) -> Result<Subject, Failure> {
    let Some(Loaded { mesh, origin, .. }) = from else {
        let path = Path::new(args.views.as_deref().unwrap_or_default());
        let progress = Progress::spinner("pictures");
        let read = Views::open_with(path, &args.views_options(), budget);
        drop(progress);
        let (views, files, notes) = read?;
        notes.iter().for_each(|text| note(text));
        outputs.spare(files)?;
        return Ok(Subject::of(views)?);
    };
    let count = args.count_of_views()?;
    let mesh = super::held(mesh, renderer)?;
    let one_color = matches!(mesh.appearance(), Appearance::Uniform(_)) && args.color && !args.texture;
    if one_color && args.targets.shading.is_none() {
        note("the mesh has one colour, so its views are lit (--shading none turns the light off)");
    }
    let progress = Progress::counted("view", count);
    let mut subject = Subject::rendered(mesh, &args.views_of_mesh(count), renderer, || progress.step())?;
    drop(progress);
    subject.one_color = one_color;
    if let Some(folder) = &args.files.write_views {
        subject.views.save(folder)?;
        if origin != [0.0; 3] {
            let [x, y, z] = origin;
            note(&format!(
                "the cameras of the views that are written are relative to {x},{y},{z}, where the mesh lies"
            ));
        }
    }
    Ok(subject)
}

/// Shows what a fit tells. Ctrl-C ends it.
fn tell(progress: &Progress, event: Event<'_>, stop: &AtomicBool) -> ControlFlow<()> {
    match event {
        Event::Plan(text) | Event::Note(text) => progress.note(text),
        Event::Progress(at) => progress.at(&at.stage.to_string(), at.taken, at.of, at.loss),
    }
    if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// Takes all steps, or those until Ctrl-C, and makes the texture after them.
fn work(
    args: &FitArgs,
    fitting: &mut Fitting,
    film: &mut Option<Film>,
    renderer: &mut Renderer,
    stop: &AtomicBool,
) -> Result<Option<Painted>, Failure> {
    let (first, count) = (fitting.next_step(), fitting.step_count());
    let progress = Progress::spinner("step");
    loop {
        let at = fitting.next_step();
        // The first state needs no checkpoint: it is that of the template, or of the checkpoint that was read.
        if at > first && at < count && at.is_multiple_of(CHECKPOINT_STEPS) {
            write_checkpoint(args, fitting)?;
        }
        if let Some(film) = film.as_mut().filter(|film| film.shows(at) && at < count) {
            film.add(fitting.mesh(), renderer)?;
        }
        if !fitting.step(renderer, &mut |event| tell(&progress, event, stop))? {
            break;
        }
    }
    let at = fitting.next_step();
    if at < count {
        progress.note(&format!("interrupted before step {at}: this is the best so far"));
    }
    end(args, fitting, film, renderer)?;
    let painted = fitting.paint(renderer, &mut |event| tell(&progress, event, stop))?;
    if let (Some(film), Some(painted)) = (film, &painted) {
        film.add(&painted.mesh, renderer)?;
    }
    Ok(painted)
}

/// The last frame of the film, and the checkpoint of the end.
fn end(args: &FitArgs, fitting: &Fitting, film: &mut Option<Film>, renderer: &mut Renderer) -> Result<(), Failure> {
    if let Some(film) = film {
        film.add(fitting.mesh(), renderer)?;
    }
    write_checkpoint(args, fitting)
}

/// Writes the state before the next step, where a checkpoint is wanted.
fn write_checkpoint(args: &FitArgs, fitting: &Fitting) -> Result<(), Failure> {
    let Some(path) = &args.files.checkpoint else { return Ok(()) };
    Ok(fitting.save_checkpoint(path)?)
}
