//! How far the colours that networks see are from the objects' own, compared with methods without a network.
//!
//! A mesh that a network sees in a picture is compared with the object in the view a quarter turn on, which shows surfaces that
//! the network did not see. Only pixels that both cover count, so that a wrong shape does not count as a wrong colour.

use crate::data::{Object, Set};
use crate::evaluate::{Table, mean, views};
use crate::network::{Network, meshes};
use crate::scores::Known;
use crate::{SIZE, VIEWS, camera, hard};
use burn::tensor::Device;
use softras::{Mesh, Renderer, Result, Scene, Settings};

const PIXELS: usize = SIZE * SIZE;

/// The colour of a pixel that the object covers.
type Color = Option<[f32; 3]>;

/// The table of a test set: the mean absolute difference of the colours, which are in [0, 1], over `count` views of every object.
/// Networks without colours have no row, and those of one name are the runs of one row.
pub fn table(
    renderer: &mut Renderer,
    train: &Set,
    test: &Set,
    networks: &[(String, Network)],
    count: usize,
    device: &Device,
) -> Result<Table> {
    let known = Known::new(train);
    // The mean over views of the difference between the colours predicted from a picture and the truth a quarter turn on.
    let score = |object: &Object, said: &dyn Fn(&[u8], usize) -> Vec<Color>| {
        let one = |view| difference(&said(object.picture(view), turned(view)), &truth(object, view));
        Ok(mean(views(count).map(one)))
    };
    let mut table = Table::new("colour error", test);
    table.add("mean colour of the picture", test, |object| {
        score(object, &|picture, _| vec![Some(mean_color(&of_picture(picture))); PIXELS])
    })?;
    table.add("retrieval by picture", test, |object| {
        score(object, &|picture, turned| of_picture(known.by_picture(picture).picture(turned)))
    })?;
    for (name, network) in networks.iter().filter(|(_, network)| network.is_colored()) {
        table.add(name, test, |object| {
            let pictures: Vec<&[u8]> = views(count).map(|view| object.picture(view)).collect();
            let seen = of_meshes(renderer, meshes(network, &pictures, device)?, views(count).map(turned))?;
            Ok(mean(seen.iter().zip(views(count)).map(|(seen, view)| difference(seen, &truth(object, view)))))
        })?;
    }
    Ok(table)
}

fn turned(view: usize) -> usize {
    (view + VIEWS / 4) % VIEWS
}

fn truth(object: &Object, view: usize) -> Vec<Color> {
    of_picture(object.picture(turned(view)))
}

/// The colours of meshes without light, each in its view.
fn of_meshes(
    renderer: &mut Renderer,
    meshes: Vec<Mesh>,
    views: impl Iterator<Item = usize>,
) -> Result<Vec<Vec<Color>>> {
    let count = meshes.len();
    let settings = hard(Settings { width: SIZE as u32, height: SIZE as u32, ..Settings::default() });
    let cameras = views.map(camera).collect::<Result<Vec<_>>>()?;
    let frame = renderer.render(&Scene::batch(meshes), &cameras, &settings)?;
    let (color, silhouette) = (frame.color()?, frame.silhouette()?);
    let of_view = |view: usize| {
        let colors = color.view(view).as_chunks::<3>().0;
        silhouette.view(view).iter().zip(colors).map(|(alpha, color)| (*alpha > 0.5).then_some(*color)).collect()
    };
    Ok((0..count).map(of_view).collect())
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
    let apart: Vec<f64> = both.map(|(a, b)| mean((0..3).map(|k| f64::from((a[k] - b[k]).abs())))).collect();
    if apart.is_empty() { 1.0 } else { mean(apart) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::config::Coloring;
    use crate::synthesis;

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

    #[test]
    fn the_table_of_colors_has_every_row() {
        let (set, device) = (synthesis::tests::small(), Device::flex());
        let network = |coloring| Network::new(2, coloring, &device).unwrap();
        let networks = [("new".into(), network(Some(Coloring::Palette))), ("shape".into(), network(None))];
        let table = table(&mut Renderer::new().unwrap(), &set, &set, &networks, 2, &device).unwrap();
        let names: Vec<&str> = table.rows.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["mean colour of the picture", "retrieval by picture", "new"]);
        let [painted, nearest, new] = [0, 1, 2].map(|i| mean(table.rows[i].1[0].iter().copied()));
        // The nearest training picture is the picture itself. A new palette gives colours of the picture, too.
        assert!(nearest == 0.0 && painted > 0.01 && new > 0.01 && new < 2.0 * painted, "{table}");
    }
}
