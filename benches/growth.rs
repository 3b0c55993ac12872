//! How time grows, with fitted exponents: `cargo bench --bench growth`, or `-- full` up to a million faces and 2048².
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod subject;

use softras::Renderer;
use softras_check::measure::{subject::settings, sweep::growth};

fn main() {
    let mut renderer = Renderer::new().expect("a Vulkan device");
    let (name, mesh) = subject::mesh("spot");
    println!("{name} on {}: frames, forward and backward, colour and silhouette, 256²", renderer.device_name());
    let all = growth(&mut renderer, &mesh, &settings(256), 9, subject::asked("full")).expect("frames");
    for growth in all {
        println!("{}: time ~ x^{:.2}", growth.name, growth.exponent());
        growth.points.iter().for_each(|(x, ms)| println!("    {x:>12e} {ms:>10.2} ms"));
    }
}
