//! `softras check`: compares a device with the f64 reference on small scenes.

use super::{Failure, say};
use clap::Args;
use serde_json::{Value, json};
use softras::Renderer;
use softras_check::check::{CheckCase, Findings, GRADIENTS, IMAGE_TOLERANCE, IMAGES, cases, compare};
use std::time::Instant;

/// Test a device: compare small scenes and gradients with the model in f64
#[derive(Args, Debug)]
#[command(after_help = "\
Each row is a scene: the largest error of each image, and the error of each
gradient relative to f64. `same` says whether a second run gave the same bits.
The last line is PASS or FAIL; the exit code is 0 or 1.

Examples:
  softras check
  softras check --device llvmpipe
  softras check --json > check.json")]
pub struct CheckArgs {
    /// Vulkan device: its index or a part of its name (`softras devices`)
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: &CheckArgs) -> Result<(), Failure> {
    let start = Instant::now();
    let mut renderer = super::open_device(args.device.as_deref(), None)?;
    let cases = cases()?;
    if !args.json {
        header(&renderer)?;
    }
    let (mut passed, mut rows) = (0, Vec::new());
    for case in &cases {
        let result = compare(&mut renderer, case);
        let pass = result.as_ref().is_ok_and(|findings| findings.pass(case.gradient_tolerance));
        passed += usize::from(pass);
        if args.json {
            rows.push(as_json(case, &result, pass));
        } else {
            say(&row(case, &result, pass))?;
        }
    }
    let (all, seconds) = (cases.len(), start.elapsed().as_secs_f64());
    if args.json {
        let info = renderer.device_info();
        let (major, minor, patch) = info.api_version;
        let object = json!({
            "device": info.name, "kind": info.kind.to_string(), "driver": info.driver,
            "driver_version": info.driver_version, "api_version": format!("{major}.{minor}.{patch}"),
            "image_tolerance": IMAGE_TOLERANCE,
            "scenes": rows, "passed": passed, "pass": passed == all, "seconds": seconds,
        });
        say(&object.to_string())?;
    } else {
        let verdict = if passed == all { "PASS" } else { "FAIL" };
        say(&format!("{verdict}: {passed} of {all} scenes as the model says, in {seconds:.1} s"))?;
    }
    if passed == all { Ok(()) } else { Err(Failure::Told) }
}

fn header(renderer: &Renderer) -> Result<(), Failure> {
    let info = renderer.device_info();
    say(&format!("{} ({}, {} {})", info.name, info.kind, info.driver, info.driver_version))?;
    say(&format!("{:12} {:24} {:40}", "", "| images, largest error", "| gradients, relative error"))?;
    let columns: String = IMAGES.iter().chain(&GRADIENTS).map(|name| format!(" {name:>6}")).collect();
    say(&format!("{:11}{columns}  same", "scene"))
}

fn row(case: &CheckCase, result: &softras::Result<Findings>, pass: bool) -> String {
    let mark = if pass { "" } else { "  <- FAIL" };
    match result {
        Err(error) => format!("{:11} {error}{mark}", case.name),
        Ok(findings) => {
            let cell = |error: &Option<f64>| error.map_or(format!(" {:>6}", "-"), |error| format!(" {error:>6.0e}"));
            let cells: String = findings.images.iter().chain(&findings.gradients).map(cell).collect();
            format!("{:11}{cells}  {:4}{mark}", case.name, if findings.repeats { "yes" } else { "NO" })
        }
    }
}

fn as_json(case: &CheckCase, result: &softras::Result<Findings>, pass: bool) -> Value {
    let named = |names: &[&str], errors: &[Option<f64>]| -> Value {
        names.iter().zip(errors).map(|(name, error)| (name.trim_end_matches('.').to_string(), json!(error))).collect()
    };
    match result {
        Err(error) => json!({ "scene": case.name, "about": case.about, "pass": pass, "error": error.to_string() }),
        Ok(findings) => json!({
            "scene": case.name, "about": case.about, "pass": pass, "gradient_tolerance": case.gradient_tolerance, "repeats": findings.repeats,
            "images": named(&IMAGES, &findings.images), "gradients": named(&GRADIENTS, &findings.gradients),
        }),
    }
}
