//! Copies between images, whose channels lie together, and the device's buffers, where a pixel has a multiple of four floats.
//!
//! A large image is copied on all cores: one of them fills fresh memory at a fraction of what the machine can do.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

/// The pixels that a core copies at once: of this many its threads are worth their start.
const PART: usize = 1 << 16;

/// As many texels as the first-level cache holds, so that each is read from mapped memory once.
const AT_ONCE: usize = 1024;

/// The memory of large images that were dropped, for those of the next frame: a system takes milliseconds to give out fresh pages.
#[derive(Clone, Debug, Default)]
pub(super) struct Spare(Arc<Mutex<Vec<Vec<f32>>>>);

impl Spare {
    /// Floats below which an image's memory is not kept: the system keeps it itself.
    const LEAST: usize = 1 << 20;

    /// Floats of all that is kept.
    const MOST: usize = 1 << 26;

    /// So many floats of any values.
    fn take(&self, count: usize) -> Vec<f32> {
        if count >= Self::LEAST {
            let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(at) = kept.iter().position(|one| one.len() == count) {
                return kept.swap_remove(at);
            }
            // Images of other sizes are not expected again.
            kept.clear();
        }
        vec![0.0; count]
    }

    /// Keeps an image's memory if it is worth it.
    pub(super) fn give(&self, data: Vec<f32>) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let floats = kept.iter().map(Vec::len).sum::<usize>() + data.len();
        if data.len() >= Self::LEAST && floats <= Self::MOST {
            kept.push(data);
        }
    }
}

/// The first three of every four floats, and the fourth ones if they are wanted.
pub(super) fn split(texels: &[[f32; 4]], fourth: bool, spare: &Spare) -> (Vec<f32>, Option<Vec<f32>>) {
    let mut first = spare.take(3 * texels.len());
    let mut fourths = spare.take(if fourth { texels.len() } else { 0 });
    let mut rest = fourths.chunks_mut(PART);
    let parts = texels.chunks(PART).zip(first.as_chunks_mut::<3>().0.chunks_mut(PART));
    on_all_cores(parts.map(|part| (part, rest.next().unwrap_or_default())), |((texels, first), fourths)| {
        let mut fourths = fourths.chunks_mut(AT_ONCE);
        for (texels, first) in texels.chunks(AT_ONCE).zip(first.chunks_mut(AT_ONCE)) {
            first.iter_mut().zip(texels).for_each(|(to, &[x, y, z, _])| *to = [x, y, z]);
            let fourths = fourths.next().unwrap_or_default();
            fourths.iter_mut().zip(texels).for_each(|(to, &[.., w])| *to = w);
        }
    });
    (first, fourth.then_some(fourths))
}

/// The first floats of every `stride`.
pub(super) fn first(floats: &[f32], stride: usize, channels: usize, spare: &Spare) -> Vec<f32> {
    let mut data = spare.take(floats.len() / stride * channels);
    on_all_cores(floats.chunks(PART * stride).zip(data.chunks_mut(PART * channels)), |(from, to)| {
        for (to, from) in to.chunks_exact_mut(channels).zip(from.chunks_exact(stride)) {
            to.copy_from_slice(&from[..channels]);
        }
    });
    data
}

/// A copy of the floats.
pub(super) fn copied(floats: &[f32], spare: &Spare) -> Vec<f32> {
    let mut data = spare.take(floats.len());
    on_all_cores(floats.chunks(PART).zip(data.chunks_mut(PART)), |(from, to)| to.copy_from_slice(from));
    data
}

/// Three floats of each pixel and the fourth's, which is 0 where kernels do not read it.
pub(super) fn join(texels: &mut [[f32; 4]], first: &[[f32; 3]], fourths: Option<&[f32]>) {
    let mut rest = fourths.unwrap_or_default().chunks(PART);
    let parts = texels.chunks_mut(PART).zip(first.chunks(PART)).map(|part| (part, rest.next()));
    on_all_cores(parts, |((texels, first), fourths)| match fourths {
        Some(fourths) => {
            texels.iter_mut().zip(first).zip(fourths).for_each(|((to, &[x, y, z]), &w)| *to = [x, y, z, w]);
        }
        None => texels.iter_mut().zip(first).for_each(|(to, &[x, y, z])| *to = [x, y, z, 0.0]),
    });
}

/// Does the work of each part, on threads that end with the call if there are several parts.
fn on_all_cores<T: Send>(parts: impl ExactSizeIterator<Item = T> + Send, work: impl Fn(T) + Sync) {
    let others = match parts.len() {
        0 | 1 => 0,
        parts => thread::available_parallelism().map_or(1, usize::from).min(parts) - 1,
    };
    let parts = Mutex::new(parts);
    let next = || parts.lock().unwrap_or_else(PoisonError::into_inner).next();
    let run = || std::iter::from_fn(next).for_each(&work);
    thread::scope(|scope| {
        for _ in 0..others {
            if thread::Builder::new().spawn_scoped(scope, run).is_err() {
                // This thread does what others cannot.
                break;
            }
        }
        run();
    });
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn images_of_several_parts_are_copied_whole() {
        let spare = Spare::default();
        for count in [0, 1, PART - 1, PART, PART + 1, 3 * PART + 5, Spare::LEAST, Spare::LEAST] {
            let texels: Vec<[f32; 4]> = (0..count).map(|i| [0, 1, 2, 3].map(|c| (4 * i + c) as f32)).collect();
            let (rgb, alpha) = split(&texels, true, &spare);
            assert_eq!(split(&texels, false, &spare), (rgb.clone(), None));
            let mut joined = vec![[f32::NAN; 4]; count];
            join(&mut joined, rgb.as_chunks().0, alpha.as_deref());
            assert_eq!(joined, texels);
            join(&mut joined, rgb.as_chunks().0, None);
            assert!(joined.iter().zip(&texels).all(|(a, b)| a[..3] == b[..3] && a[3] == 0.0));
            let floats = texels.as_flattened();
            assert_eq!(copied(floats, &spare), floats);
            assert_eq!(first(floats, 4, 3, &spare), rgb);
            // The next images are written over these.
            spare.give(vec![f32::NAN; 3 * count]);
            spare.give(vec![f32::NAN; count]);
        }
    }

    #[test]
    fn memory_is_kept_for_images_of_the_same_size_alone() {
        let (spare, count) = (Spare::default(), Spare::LEAST);
        let held = |spare: &Spare| spare.0.lock().unwrap().iter().map(Vec::len).sum::<usize>();
        spare.give(vec![1.0; count - 1]);
        spare.give(vec![1.0; Spare::MOST + 1]);
        assert_eq!(held(&spare), 0);
        spare.give(vec![1.0; count]);
        assert!(spare.take(8) == [0.0; 8] && held(&spare) == count);
        assert!(spare.take(count).iter().all(|x| *x == 1.0) && held(&spare) == 0);
        spare.give(vec![1.0; count]);
        assert!(spare.take(count + 1).iter().all(|x| *x == 0.0) && held(&spare) == 0);
    }
}
