//! How far the colours that networks see are from the objects' own, beside what needs no network.
//!
//! A mesh that a network sees in a picture is compared with the object in the view a quarter turn on, which shows surfaces that
//! the network did not see. Only pixels that both cover count, so that a wrong shape does not count as a wrong colour.

use super::data::Set;
use super::evaluate::{Score, Table, add_run, by_class, check_views, mean, views};
use super::model::Model;
use super::network::{Network, meshes};
use super::scores::Known;
use super::{SIZE, VIEWS, camera};
use burn::tensor::Device;
use softras::scene::{ColorAggregation, Distance, SilhouetteAggregation};
use softras::{Mesh, Renderer, Result, Scene, Settings};

/// Pixels of a picture.
const PIXELS: usize = SIZE * SIZE;

/// The colour of a pixel that the object covers.
type Color = Option<[f32; 3]>;

/// The table of a test set: the mean absolute difference of the colours, which are in [0, 1], over `count` views of every object.
/// Networks without colours have no row, and those of one name are the runs of one row.
///
/// # Errors
/// [`softras::Error::Fit`] for a number of views outside 1 to 24; as [`meshes`] and [`Renderer::render`].
pub fn table(
    renderer: &mut Renderer,
    train: &Set,
    test: &Set,
    networks: &[(String, Model)],
    count: usize,
    device: &Device,
) -> Result<Table> {
    check_views(count)?;
    let known = Known::new(train);
    // The mean over views of the difference between what is said of a picture, and the truth a quarter turn on.
    let of_views = |said: &dyn Fn(&[u8], usize) -> Vec<Color>| {
        by_class(test, |object| {
            let one = |view: usize| {
                let turned = turned(view);
                difference(&said(object.picture(view), turned), &of_picture(object.picture(turned)))
            };
            Ok(mean(views(count).map(one)))
        })
    };
    let painted = of_views(&|picture, _| vec![Some(mean_color(&of_picture(picture))); PIXELS])?;
    let nearest = of_views(&|picture, turned| of_picture(known.by_picture(picture).picture(turned)))?;
    let mut rows = vec![
        Score { name: "mean colour of the picture".into(), runs: vec![painted] },
        Score { name: "retrieval by picture".into(), runs: vec![nearest] },
    ];
    for (name, network) in networks {
        let Model::Mesh(network) = network else { continue };
        if network.is_colored() {
            add_run(&mut rows, name, of_network(renderer, test, network, count, device)?);
        }
    }
    Ok(Table { head: "colour error".into(), classes: test.classes.clone(), rows })
}

fn turned(view: usize) -> usize {
    (view + VIEWS / 4) % VIEWS
}

fn of_network(
    renderer: &mut Renderer,
    test: &Set,
    network: &Network,
    count: usize,
    device: &Device,
) -> Result<Vec<f64>> {
    by_class(test, |object| {
        let pictures: Vec<&[u8]> = views(count).map(|view| object.picture(view)).collect();
        let seen = of_meshes(renderer, meshes(network, &pictures, device)?, views(count).map(turned))?;
        let truth = views(count).map(|view| of_picture(object.picture(turned(view))));
        Ok(mean(seen.iter().zip(truth).map(|(seen, truth)| difference(seen, &truth))))
    })
}

/// The colours of meshes without light, each in its view.
fn of_meshes(
    renderer: &mut Renderer,
    meshes: Vec<Mesh>,
    views: impl Iterator<Item = usize>,
) -> Result<Vec<Vec<Color>>> {
    let count = meshes.len();
    let settings = Settings {
        width: SIZE as u32,
        height: SIZE as u32,
        color: ColorAggregation::Hard,
        silhouette: SilhouetteAggregation::Hard,
        distance: Distance::Hard,
        ..Settings::default()
    };
    let cameras = views.map(camera).collect::<Result<Vec<_>>>()?;
    let frame = renderer.render(&Scene::batch(meshes), &cameras, &settings)?;
    let (color, silhouette) = (frame.color()?, frame.silhouette()?);
    let color = |mesh: usize, i: usize| {
        let (row, column) = (i / SIZE, i % SIZE);
        (silhouette.pixel(mesh, row, column)[0] > 0.5).then(|| [0, 1, 2].map(|k| color.pixel(mesh, row, column)[k]))
    };
    Ok((0..count).map(|mesh| (0..PIXELS).map(|i| color(mesh, i)).collect()).collect())
}

fn of_picture(picture: &[u8]) -> Vec<Color> {
    let at = |plane: usize, i: usize| f32::from(picture[plane * PIXELS + i]) / 255.0;
    // Pictures have their colours over black.
    (0..PIXELS).map(|i| (at(3, i) > 0.5).then(|| [0, 1, 2].map(|plane| at(plane, i) / at(3, i)))).collect()
}

fn mean_color(colors: &[Color]) -> [f32; 3] {
    let seen: Vec<&[f32; 3]> = colors.iter().flatten().collect();
    [0, 1, 2].map(|k| seen.iter().map(|color| color[k]).sum::<f32>() / seen.len().max(1) as f32)
}

/// The mean absolute difference over the pixels that both cover; 1 where there are none.
fn difference(a: &[Color], b: &[Color]) -> f64 {
    let both = a.iter().zip(b).filter_map(|(a, b)| a.zip(*b));
    let apart: Vec<f64> =
        both.map(|(a, b)| (0..3).map(|k| f64::from((a[k] - b[k]).abs())).sum::<f64>() / 3.0).collect();
    if apart.is_empty() { 1.0 } else { mean(apart.into_iter()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_both_cover_counts() {
        let (red, dark) = (Some([1.0, 0.0, 0.0]), Some([0.25, 0.0, 0.0]));
        assert_eq!(difference(&[red, red, None], &[dark, None, dark]), 0.25);
        assert_eq!(difference(&[red, None], &[None, red]), 1.0);
        // A pixel of a picture is covered from half its alpha on, and its colour is freed of the black behind it.
        let mut picture = vec![0; 4 * PIXELS];
        (picture[0], picture[3 * PIXELS]) = (100, 200);
        (picture[1], picture[3 * PIXELS + 1]) = (100, 100);
        let colors = of_picture(&picture);
        assert_eq!(colors[0], Some([0.5, 0.0, 0.0]));
        assert!(colors[1..].iter().all(Option::is_none));
        assert_eq!(mean_color(&colors), [0.5, 0.0, 0.0]);
    }
}
