//! `softras each`: a command of softras for each mesh of a folder.

mod job;
mod log;

use super::{Failure, note, parse, say};
use clap::{Args, ValueEnum};
use job::{Job, Outcome};
use log::Log;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

/// Run a command of softras for each mesh of a folder, and print one line of JSON for each
#[derive(Args, Debug)]
#[command(after_help = "\
In the words of the command {path} stands for the mesh's path, {file} for its name in the folder, and
{name} for that without its ending. The folders of what a job writes are made. Each job is a process of its own, so that one that fails leaves
the others alone. Its line of JSON has:

  job       the name in the folder
  command   the words after softras
  status    its exit code, 0 for success; null if a signal ended it
  seconds   its run time
  output    what it printed, as JSON where it is JSON
  messages  its notes and errors

The exit code is 1 if a job failed. Ctrl-C starts no further job and waits for those that run, which
write their best so far.

Examples:
  softras each scans -- render {path} -o pictures/{name}.png
  softras each scans --log fits.jsonl -- fit --from {path} -o fitted/{name}.obj --quiet
  softras each fitted --jobs 2 -- iou {path} scans/{file} --json
  softras each scans --shard $SLURM_ARRAY_TASK_ID/16 --log fits.$SLURM_ARRAY_TASK_ID.jsonl -- fit
    --from {path} -o fitted/{name}.obj")]
pub struct EachArgs {
    /// The folder
    pub folder: PathBuf,
    /// What is a job: each mesh file of the folder, each of its folders (as for fit --views), or each of its files
    #[arg(long, value_enum, default_value_t = Kind::Mesh)]
    pub of: Kind,
    /// Jobs that run at the same time. A device that is a processor is busy with one
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=256))]
    pub jobs: u32,
    /// Take every Nth job, from number I on; I counts from 0. For job arrays
    #[arg(long, value_name = "I/N", default_value = "0/1", value_parser = parse::shard)]
    pub shard: (usize, usize),
    /// Also add the lines to this file, and leave out jobs that are in it with status 0 and the same command. So a run that was
    /// ended goes on when it is started again
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// The command and its options, behind `--`
    #[arg(last = true, required = true, value_name = "COMMAND")]
    pub command: Vec<String>,
}

/// What in a folder is a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Files that end in .obj, .ply, .stl, .gltf or .glb
    Mesh,
    /// Folders
    Folder,
    /// Files
    File,
}

impl Kind {
    fn has(self, path: &Path) -> bool {
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
        let is_mesh =
            ["obj", "ply", "stl", "gltf", "glb"].iter().any(|known| ending.as_deref() == Some(known.as_ref()));
        match self {
            Self::Mesh => is_mesh && path.is_file(),
            Self::Folder => path.is_dir(),
            Self::File => path.is_file(),
        }
    }

    fn plural(self) -> &'static str {
        match self {
            Self::Mesh => "meshes (.obj, .ply, .stl, .gltf, .glb)",
            Self::Folder => "folders",
            Self::File => "files",
        }
    }
}

/// Runs the command.
pub fn run(args: &EachArgs) -> Result<(), Failure> {
    let outputs = job::outputs(&args.command)?;
    let mut jobs = jobs(args, &outputs)?;
    let log = args.log.as_deref().map(Log::open).transpose()?;
    let all = jobs.len();
    if let Some(log) = &log {
        jobs.retain(|job| !log.has(job));
    }
    if jobs.len() < all {
        note(&format!("{} of {all} jobs are done already, by the log", all - jobs.len()));
    }
    let failed = finish(&jobs, args.jobs as usize, log)?;
    if failed > 0 {
        note(&format!("{failed} of {} jobs failed", jobs.len()));
        return Err(Failure::Told);
    }
    Ok(())
}

/// The jobs of this shard, in the order of their names.
fn jobs(args: &EachArgs, outputs: &[String]) -> Result<Vec<Job>, Failure> {
    let refused = |source| softras::Error::Io { path: args.folder.clone(), source };
    let entries: Result<Vec<_>, _> = std::fs::read_dir(&args.folder).map_err(refused)?.collect();
    let paths = entries.map_err(refused)?.into_iter().map(|entry| entry.path());
    let is_hidden = |path: &PathBuf| path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    let mut paths: Vec<PathBuf> = paths.filter(|path| !is_hidden(path) && args.of.has(path)).collect();
    paths.sort();
    if paths.is_empty() {
        let what = format!("{}: no {} in this folder", args.folder.display(), args.of.plural());
        let fix = if args.of == Kind::Mesh {
            "folders in it are not searched; --of says what else is a job"
        } else {
            "--of says what else is a job"
        };
        return Err(Failure::Usage(format!("{what}; {fix}")));
    }
    let (index, count) = args.shard;
    paths.into_iter().skip(index).step_by(count).map(|path| Job::new(&path, &args.command, outputs)).collect()
}

/// Runs the jobs, some at a time, and returns how many failed.
fn finish(jobs: &[Job], at_once: usize, mut log: Option<Log>) -> Result<usize, Failure> {
    let stop = super::interrupted()?;
    let program = std::env::current_exe().map_err(|source| softras::Error::Io { path: "softras".into(), source })?;
    // Also where a result cannot be written, which ends the work as Ctrl-C does.
    let lost = AtomicBool::new(false);
    let next = AtomicUsize::new(0);
    let (done, results) = mpsc::channel::<(usize, Outcome)>();
    std::thread::scope(|scope| {
        for _ in 0..at_once.min(jobs.len()) {
            let done = done.clone();
            let (next, lost, program) = (&next, &lost, &program);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) && !lost.load(Ordering::Relaxed) {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(job) = jobs.get(at) else { break };
                    if done.send((at, job.run(program))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(done);
        let mut failed = 0;
        let mut written = Ok(());
        for (at, outcome) in results {
            failed += usize::from(!outcome.is_good());
            let line = outcome.line(&jobs[at]);
            let own = log.as_mut().map_or(Ok(()), |log| log.add(&line)).and_then(|()| say(&line));
            lost.store(own.is_err() || written.is_err(), Ordering::Relaxed);
            written = written.and(own);
        }
        written?;
        if stop.load(Ordering::Relaxed) { Err(Failure::Interrupted) } else { Ok(failed) }
    })
}
