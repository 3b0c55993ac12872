//! The program of this package: `eval` renders archives of arrays.

mod eval;

use eval::{KEYS, Options};
use std::process::ExitCode;

const USAGE: &str = "Usage: softras-lab eval SCENE.npz -o OUT.npz [OPTIONS]";

const OPTIONS: &str = "\
Renders the scene of a numpy archive into another one.

  SCENE.npz         the scene, as numpy.savez or numpy.savez_compressed writes it
  -o, --out FILE    the archive to write
  --parity RULES    model (default): the rules of softras; official: the image of the official code
                    with all its quirks; in screen space, front faces are then clockwise and the
                    options are rounded to float32
  --gradient MODE   also differentiate a loss, which the scene gives by its derivatives by the
                    images: exact, or paper, the gradient of the paper and of the official code
  --device DEVICE   the Vulkan device: its index or a part of its name; or `reference`, the f64
                    reference (default: the best device)";

fn main() -> ExitCode {
    let mut words = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    let first = words.next();
    if matches!(first.as_deref(), None | Some("-h" | "--help")) {
        println!("{USAGE}\n\n{OPTIONS}\n\n{KEYS}");
        return ExitCode::SUCCESS;
    }
    let options = if first.as_deref() == Some("eval") {
        Options::parse(words)
    } else {
        Err("the only tool is `eval`".to_string())
    };
    let (what, code) = match options.as_ref().map(eval::run) {
        Ok(Ok(line)) => {
            println!("{line}");
            return ExitCode::SUCCESS;
        }
        Ok(Err(error)) => (error.to_string(), 1),
        Err(what) => (format!("{what}\n\n{USAGE}"), 2),
    };
    eprintln!("error: {what}");
    ExitCode::from(code)
}
