//! `softras fit --benchmark`: fits to views of known meshes, with the distance of every fit from its mesh.

use super::Work;
use super::args::FitArgs;
use super::baselines::{self, Baseline};
use super::report::genus;
use super::setup::Setup;
use super::surface::chamfer;
use super::targets::{self, Views};
use crate::commands::outputs::Outputs;
use crate::commands::{Failure, say};
use softras_io::text;
use serde_json::{Value, json};
use softras::shapes;
use softras::{Mesh, Renderer};
use softras_fit::voxel_iou;
use softras_io::Budget;
use softras_io::output;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The meshes that are fitted where none are given.
const MADE: [&str; 4] = ["torus", "double-torus", "mug", "chair"];
/// Voxels along a side of the grid of the 3D IoU.
const VOXELS: usize = 64;

/// A mesh that a method has made, compared with the one that it should be.
struct Row {
    mesh: String,
    method: &'static str,
    iou: f64,
    chamfer: f64,
    /// Parts and handles: what was found, and what there is.
    found: (usize, Option<usize>),
    truth: (usize, Option<usize>),
    seconds: f64,
}

impl Row {
    fn json(&self) -> Value {
        json!({
            "mesh": self.mesh, "method": self.method, "iou_3d": self.iou, "chamfer": self.chamfer,
            "parts": self.found.0, "genus": self.found.1, "true_parts": self.truth.0, "true_genus": self.truth.1,
            "seconds": self.seconds,
        })
    }

    /// The row as one of a table in Markdown.
    fn line(&self) -> String {
        let genus = |(parts, genus): (usize, Option<usize>)| {
            let parts = if parts == 1 { String::new() } else { format!(" ({parts} parts)") };
            genus.map_or("open".into(), |genus| genus.to_string()) + &parts
        };
        let (mesh, method) = (text::name(&self.mesh), self.method);
        let (found, truth) = (genus(self.found), genus(self.truth));
        let [iou, chamfer] = [format!("{:.3}", self.iou), format!("{:.4}", self.chamfer)];
        line(&[&mesh, method, &iou, &chamfer, &found, &truth, &format!("{:.0}", self.seconds)])
    }
}

/// A line of the table.
fn line(cells: &[&str; 7]) -> String {
    const WIDTHS: [usize; 7] = [12, 28, 6, 7, 5, 7, 7];
    let cells = cells.iter().zip(WIDTHS).map(|(cell, width)| format!(" {cell:<width$} |"));
    cells.fold("|".into(), |line, cell| line + &cell)
}

/// Fits every mesh and prints a row for each fit as soon as it is known.
pub fn run(args: &FitArgs, meshes: &[PathBuf]) -> Result<(), Failure> {
    let outputs = Outputs::new(&args.files.json, [])?;
    outputs.spare(meshes)?;
    let budget = Budget::new(args.read.memory.memory);
    let mut truths = Vec::new();
    if meshes.is_empty() {
        for name in MADE {
            truths.push((name.to_string(), shapes::by_name(name)?));
        }
    }
    for path in meshes {
        truths.push((name(path), args.read.read(path, true, &outputs, &budget)?.mesh));
    }
    let mut renderer = crate::commands::open_device(args.device.as_deref(), args.read.memory.memory)?;
    say(&line(&["mesh", "method", "3D IoU", "Chamfer", "genus", "of mesh", "seconds"]))?;
    say(&line(&["---"; 7]))?;
    let mut rows = Vec::new();
    for (name, truth) in truths {
        let mut add = |row: Row| {
            let line = row.line();
            rows.push(row);
            say(&line)
        };
        if let Err(failure) = rows_of(args, &name, truth, &mut add, &mut renderer) {
            // What was measured before is kept.
            write(args, &rows, &renderer)?;
            return Err(failure);
        }
    }
    write(args, &rows, &renderer)
}

/// A file's name without folder and ending.
fn name(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn write(args: &FitArgs, rows: &[Row], renderer: &Renderer) -> Result<(), Failure> {
    let Some(path) = &args.files.json else { return Ok(()) };
    let rows: Vec<Value> = rows.iter().map(Row::json).collect();
    let size = [args.size.0, args.size.1];
    let report = json!({
        "device": renderer.device_name(), "views": args.count_of_views()?, "size": size, "voxels": VOXELS, "rows": rows,
    });
    Ok(output::write_file(path, report.to_string().as_bytes())?)
}

/// The fit of a mesh, what it begins with, and with `--baselines` the other methods.
fn rows_of(
    args: &FitArgs,
    name: &str,
    truth: Mesh,
    add: &mut impl FnMut(Row) -> Result<(), Failure>,
    renderer: &mut Renderer,
) -> Result<(), Failure> {
    let args = FitArgs { color: true, ..args.clone() };
    let row = |method: &'static str, mesh: &Mesh, seconds: f64| -> Result<Row, Failure> {
        let (iou, chamfer) = (voxel_iou(mesh, &truth, VOXELS)?, chamfer(mesh, &truth));
        Ok(Row { mesh: name.into(), method, iou, chamfer, found: genus(mesh)?, truth: genus(&truth)?, seconds })
    };
    let views = Views::made(&args, truth.clone(), None, args.count_of_views()?, renderer)?;
    let before = Instant::now();
    let fitted = fitted(&args, &views, renderer)?;
    let seconds = before.elapsed().as_secs_f64();
    add(row("fit", &fitted.mesh, seconds)?)?;
    add(row(fitted.begins, &fitted.begin, fitted.begin_seconds)?)?;
    if !args.method.baselines {
        return Ok(());
    }
    let sphere = FitArgs { template: "sphere".into(), ..args.clone() };
    let before = Instant::now();
    let from_sphere = self::fitted(&sphere, &views, renderer)?;
    add(row("from a sphere", &from_sphere.mesh, before.elapsed().as_secs_f64())?)?;
    for Baseline { name, mesh, seconds, .. } in baselines::run(&args, &views, renderer)? {
        add(row(name, &mesh, seconds)?)?;
    }
    Ok(())
}

/// A fit, and what it began with.
struct Fitted {
    mesh: Mesh,
    begin: Mesh,
    begins: &'static str,
    begin_seconds: f64,
}

/// Fits as `softras fit` does.
fn fitted(args: &FitArgs, views: &Views, renderer: &mut Renderer) -> Result<Fitted, Failure> {
    let before = Instant::now();
    let setup = Setup::new(args, views, renderer)?;
    let begin_seconds = before.elapsed().as_secs_f64();
    let targets = targets::fitted(args, &views.targets);
    let mut work = Work::begin(args, &setup, views, &targets)?;
    work.run(renderer)?;
    if work.interrupted {
        return Err(Failure::Interrupted);
    }
    let begins = if setup.hull { "hull alone" } else { "sphere alone" };
    let mesh = work.found();
    Ok(Fitted { mesh, begin: setup.template, begins, begin_seconds })
}
