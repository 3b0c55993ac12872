//! Several processes train as one does: two threads in their place, and with the feature `mpi` two processes of `mpirun`.
#![allow(clippy::unwrap_used)]

use burn::tensor::Device;
use softras::Renderer;
use softras_burn::reconstruct::checkpoint;
use softras_burn::reconstruct::config::{Coloring, Config, Row};
use softras_burn::reconstruct::data::Set;
use softras_burn::reconstruct::team::Team;
use softras_burn::reconstruct::train::Trainer;
use softras_burn::reconstruct::weights::Weight;
use softras_burn::reconstruct::{families, synthesis};
use std::path::Path;
use std::rc::Rc;
use std::sync::{Arc, Barrier, Mutex};

const STEPS: usize = 4;

fn config(shares: usize) -> Config {
    Config {
        width: 2,
        steps: STEPS,
        pairs: 4,
        shares,
        rate: 1e-3,
        sigma: 1e-4,
        laplacian: 3e-2,
        flatten: 5e-4,
        color: 1.0,
        coloring: Coloring::Palette,
        hard: None,
        voxels: false,
        seed: 3,
    }
}

fn set() -> Set {
    let mut renderer = Renderer::new().unwrap();
    let mut object = |seed| {
        let mesh = families::object("sofa", seed).unwrap().unwrap();
        synthesis::object(&mut renderer, 0, mesh).unwrap()
    };
    Set { classes: vec!["sofa".into()], objects: vec![object(1), object(2), object(3)] }
}

/// Two threads that take means as two processes would.
struct Threads {
    rank: usize,
    values: Arc<[Mutex<Vec<f32>>; 2]>,
    barrier: Arc<Barrier>,
}

impl Team for Threads {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        2
    }

    fn average(&self, values: &mut [f32]) {
        *self.values[self.rank].lock().unwrap() = values.to_vec();
        self.barrier.wait();
        let [first, second] = [0, 1].map(|rank| self.values[rank].lock().unwrap().clone());
        values.iter_mut().zip(first.iter().zip(second)).for_each(|(value, (a, b))| *value = (a + b) * 0.5);
        self.barrier.wait();
    }

    fn abort(&self) {}
}

fn curve(trainer: &mut Trainer, set: &Set) -> Vec<Row> {
    (0..STEPS).map(|_| trainer.step(set).unwrap()).collect()
}

/// The weights of a network in training, and its running means, as a checkpoint has them.
fn weights(trainer: &Trainer, path: &Path) -> Vec<Weight> {
    trainer.save(path).unwrap();
    checkpoint::read(path, &Device::flex(), None).unwrap().1.weights()
}

/// What two processes have before and after they gather: of all weights the same, of the batch norms' running means, of which
/// each has its own, the mean.
fn are_gathered(before: [&[Weight]; 2], after: [&[Weight]; 2]) {
    let mut apart = 0;
    for i in 0..before[0].len() {
        let [a, b] = before.map(|weights| &weights[i]);
        let mean: Vec<f32> = a.values.iter().zip(&b.values).map(|(a, b)| (a + b) * 0.5).collect();
        let is_running = a.name.contains("running");
        assert!(is_running || a.values == b.values, "{}", a.name);
        apart += usize::from(a.values != b.values);
        for weights in after {
            assert_eq!(weights[i].values, mean, "{}", a.name);
        }
    }
    // The means and the variances of three batch norms.
    assert_eq!(apart, 6);
}

#[test]
fn two_that_share_a_step_train_as_one_does() {
    let (set, folder) = (set(), tempfile::tempdir().unwrap());
    let mut alone = Trainer::new(config(2), Renderer::new().unwrap()).unwrap();
    let expected = curve(&mut alone, &set);
    let (values, barrier) = (Arc::new([const { Mutex::new(Vec::new()) }; 2]), Arc::new(Barrier::new(2)));
    let renderers = [0, 1].map(|_| Renderer::new().unwrap());
    let alone_now = Mutex::new(());
    let trained: Vec<_> = std::thread::scope(|scope| {
        let threads = renderers.into_iter().enumerate().map(|(rank, renderer)| {
            let team = Threads { rank, values: values.clone(), barrier: barrier.clone() };
            let (set, barrier, alone_now, path) = (&set, &barrier, &alone_now, folder.path().join(rank.to_string()));
            scope.spawn(move || {
                // The generator of the first weights is one for all threads.
                let new = || {
                    let _guard = alone_now.lock().unwrap();
                    Trainer::new(config(2), renderer).unwrap()
                };
                let mut trainer = new().with_team(Rc::new(team)).unwrap();
                let rows = curve(&mut trainer, set);
                let before = weights(&trainer, &path);
                trainer.gather();
                let after = weights(&trainer, &path);
                // Devices are closed one after the other.
                barrier.wait();
                let _guard = alone_now.lock().unwrap();
                drop(trainer);
                (rows, before, after)
            })
        });
        threads.collect::<Vec<_>>().into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    let (first, before, after) = &trained[0];
    let (second, other_before, other_after) = &trained[1];
    assert_eq!([first, second], [&expected; 2]);
    are_gathered([before, other_before], [after, other_after]);
    // With one share the batch norms see all pictures at once, which is another training.
    let mut whole = Trainer::new(config(1), Renderer::new().unwrap()).unwrap();
    let together = curve(&mut whole, &set);
    assert_ne!(together, expected);
    for (a, b) in together.iter().zip(&expected) {
        assert!((a.loss - b.loss).abs() < 0.02, "{a:?} {b:?}");
    }
}

#[test]
fn shares_that_do_not_divide_are_refused() {
    let refused = |config: Config| Trainer::new(config, Renderer::new().unwrap()).err().unwrap().to_string();
    assert!(refused(config(3)).contains("3 shares of 4 pairs"));
    assert!(refused(config(0)).contains("0 shares"));
    let barrier = Arc::new(Barrier::new(2));
    let team = Threads { rank: 0, values: Arc::new([const { Mutex::new(Vec::new()) }; 2]), barrier };
    let alone = Trainer::new(config(1), Renderer::new().unwrap()).unwrap();
    assert!(alone.with_team(Rc::new(team)).err().unwrap().to_string().contains("1 shares of a step for 2 processes"));
}

#[cfg(feature = "mpi")]
#[test]
fn two_processes_train_as_one_does() {
    let folder = tempfile::tempdir().unwrap();
    let run = |program: &[&str], line: &str| {
        let mut command = std::process::Command::new(program[0]);
        command.args(&program[1..]).args(line.split_whitespace()).current_dir(folder.path());
        let output = command.output().unwrap();
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    };
    let program = env!("CARGO_BIN_EXE_softras-reconstruct");
    run(&[program], "data -o data --families sofa --train 3 --val 1 --test 1");
    let line = "train data --steps 4 --width 2 --pairs 4 --shares 2 --every 4";
    run(&[program], &format!("{line} -o alone"));
    let two = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", "2", program];
    run(&two, &format!("{line} -o two"));
    let curve = |name: &str| std::fs::read_to_string(folder.path().join(name).join("curve.csv")).unwrap();
    assert_eq!(curve("two"), curve("alone"));
}
