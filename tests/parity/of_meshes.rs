//! Well-known meshes that are too large for the repository: they have the counts of their README.

use crate::recorded::folder;
use softras::scene::Appearance;
use softras_io::{LoadOptions, load_with};

pub fn counts() {
    let folder = folder().join("../meshes");
    for (name, vertices, triangles) in [
        ("spot", 2930, 5856),
        ("bunny", 35947, 69451),
        ("nefertiti", 49971, 99938),
        ("teapot", 3644, 6320),
        ("suzanne", 507, 968),
        ("cow", 2903, 5804),
        ("fandisk", 6475, 12946),
    ] {
        let loaded =
            load_with(&folder.join(name).with_extension("obj"), &LoadOptions { srgb: false, ..LoadOptions::default() })
                .unwrap();
        let counts = (loaded.mesh.positions().len(), loaded.mesh.triangles().len());
        assert_eq!(counts, (vertices, triangles), "{name}");
        let Appearance::Textured { uvs, textures, .. } = loaded.mesh.appearance() else { continue };
        assert_eq!((name, uvs.len(), textures.len()), ("spot", 3225, 1));
        assert_eq!(loaded.notes, [""; 0]);
    }
}
