//! The report of `softras render`, as text or as JSON.

use super::{Failure, RenderTarget, Stage};
use crate::commands::{describe, note, say};
use glam::DVec3;
use serde_json::{Value, json};
use softras_view::{Shot, Studio, short};
use std::time::Duration;

#[derive(Debug)]
struct WrittenPicture {
    path: String,
    output: &'static str,
    frames: usize,
    meaning: Option<String>,
}

/// The facts that are collected while frames are rendered.
#[derive(Debug)]
pub struct Report {
    device: String,
    mesh: String,
    vertices: usize,
    triangles: usize,
    notes: Vec<String>,
    frames: usize,
    bands: usize,
    samples: usize,
    /// Whether some frame shows anything of the mesh.
    is_seen: bool,
    origin: DVec3,
    first: Value,
    timings: Vec<(&'static str, f64)>,
    sweep: Option<(&'static str, Vec<f64>)>,
    written: Vec<WrittenPicture>,
}

impl Report {
    pub fn new(stage: &Stage<'_>, notes: Vec<String>) -> Self {
        Self {
            device: stage.renderer.device_name().into(),
            mesh: stage.args.mesh.display().to_string(),
            vertices: stage.vertices,
            triangles: stage.triangles,
            notes,
            frames: 0,
            bands: 0,
            samples: 0,
            is_seen: false,
            origin: stage.origin.into(),
            first: Value::Null,
            timings: Vec::new(),
            sweep: stage.args.sweep.map(|s| (s.swept.name(), Vec::new())),
            written: Vec::new(),
        }
    }

    /// Counts a frame at its first band and adds up its stages' times; camera and settings are the first frame's.
    pub fn add(&mut self, shot: &Shot) {
        if self.frames == 0 {
            let camera = describe::camera(&shot.view, self.origin);
            self.first = json!({ "camera": camera, "settings": describe::settings(&shot.settings) });
        }
        self.frames += usize::from(shot.rows.start == 0);
        self.bands += 1;
        self.samples = shot.samples;
        self.is_seen |= shot.is_seen();
        let layers = shot.layers.iter().flat_map(|layer| layer.frames());
        for time in std::iter::once(&shot.frame).chain(layers).flat_map(|frame| frame.timings()) {
            match self.timings.iter_mut().find(|(stage, _)| *stage == time.stage) {
                Some((_, sum)) => *sum += time.milliseconds,
                None => self.timings.push((time.stage, time.milliseconds)),
            }
        }
    }

    /// Records the values of a sweep.
    pub fn values(&mut self, values: Vec<f64>) {
        if let Some((_, all)) = &mut self.sweep {
            *all = values;
        }
    }

    /// Records that a file of `frames` frames was written, with the meaning of its values.
    pub fn wrote(&mut self, target: &RenderTarget, frames: usize, meaning: Option<String>) {
        let (path, output) = (target.path.display().to_string(), target.output.name());
        self.written.push(WrittenPicture { path, output, frames, meaning });
    }

    /// Notes that no frame shows anything of the mesh, if that is so, with what is likely to be the reason.
    pub fn note_nothing(&mut self, studio: &Studio) {
        if let Some(text) = studio.nothing(self.is_seen) {
            note(text);
            self.notes.push(text.into());
        }
    }

    /// Prints what was written, or everything as JSON.
    pub fn print(&self, as_json: bool, total: Duration) -> Result<(), Failure> {
        if as_json {
            return say(&self.json(total).to_string());
        }
        if let Some((name, values)) = &self.sweep {
            say(&format!("{name}: {}", short(values).join(", ")))?;
        }
        for file in &self.written {
            let frames = if file.frames > 1 { format!(", {} frames", file.frames) } else { String::new() };
            let meaning = file.meaning.as_ref().map(|m| format!("; {m}")).unwrap_or_default();
            say(&format!("{}: {}{frames}{meaning}", file.path, file.output))?;
        }
        Ok(())
    }

    fn json(&self, total: Duration) -> Value {
        let file =
            |f: &WrittenPicture| json!({ "path": f.path, "output": f.output, "frames": f.frames, "note": f.meaning });
        let stages: Vec<_> = self.timings.iter().map(|(s, ms)| json!({ "stage": s, "milliseconds": ms })).collect();
        json!({
            "device": self.device,
            "mesh": { "path": self.mesh, "vertices": self.vertices, "triangles": self.triangles },
            "frames": self.frames,
            "bands": self.bands,
            "samples": self.samples,
            "camera": self.first["camera"],
            "settings": self.first["settings"],
            "sweep": self.sweep.as_ref().map(|(name, values)| json!({ "name": name, "values": values })),
            "timings": stages,
            "device_milliseconds": self.timings.iter().map(|(_, ms)| ms).sum::<f64>(),
            "total_milliseconds": total.as_secs_f64() * 1e3,
            "files": self.written.iter().map(file).collect::<Vec<_>>(),
            "notes": self.notes,
        })
    }
}
