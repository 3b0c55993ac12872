//! The status of a pass's frame: that more room would make it faster, or that a vertex was not finite.

use super::facade::{Memory, Scenery, bind, run};
use crate::common::gradient::random_upstream;
use crate::common::tier;
use crate::host::{assert_silent, difference, engine, error, rasterizer};
use softras::embed::{Capacity, PassBuffer, PassStatus};
use softras::scene::{Background, Shading};
use softras::{GradientRequest, Lights, Settings};

/// A pass without room gives the same images and gradients as one with room, and says what would be faster.
#[test]
fn a_pass_does_not_depend_on_the_room_for_lists() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let scenery = Scenery::new(&engine);
    let case = scenery.engines.case();
    let upstream = random_upstream(&case, case.settings.outputs);
    let outputs = [PassBuffer::Color, PassBuffer::VertexGradients, PassBuffer::Totals, PassBuffer::CornerGradients];
    let looks = [
        (Lights::official(), Background::Weighted),
        (Lights { shading: Shading::Smooth, ..Lights::official() }, Background::Composite),
    ];
    for (lights, background) in looks.into_iter().take(tier(1, 2)) {
        let builder = rasterizer
            .pass(&scenery.meshes())
            .settings(Settings { background, ..case.settings.clone() })
            .cameras(&case.cameras)
            .lights(lights)
            .inside_planes()
            .gradients(GradientRequest { texels: false, uvs: false, ..GradientRequest::ALL });
        let full = Capacity { coarse: 1 << 12, list: 1 << 16, cells: 1 << 10 };
        let of = |capacity: Capacity| {
            let plan = builder.clone().capacity(capacity).build().unwrap();
            let mut memory = Memory::new(&engine, &plan);
            let pass = bind(&rasterizer, &plan, &mut memory, &scenery.buffers(true));
            memory.write_upstream(&pass, &upstream);
            run(&engine, &pass);
            assert_eq!(memory.whole_word(&pass), 1);
            (pass.status(memory.readback.bytes()).unwrap(), outputs.map(|id| memory.floats(&pass, id)), pass, memory)
        };
        let whole = of(full);
        assert_eq!(whole.0, PassStatus::Whole);
        assert!(whole.1.iter().all(|values| values.iter().any(|x| x.abs() > 1e-6)));
        for list in 0..2 {
            let mut capacity = full;
            *[&mut capacity.coarse, &mut capacity.list][list] = 1;
            let (status, values, mut pass, memory) = of(capacity);
            for ((id, values), whole) in outputs.iter().zip(&values).zip(&whole.1) {
                assert_eq!(difference(values, whole), None, "{id:?} {capacity:?}");
            }
            let PassStatus::Grow(grown) = status else { panic!("{capacity:?} is enough") };
            let next = pass.plan().next_plan(memory.readback.bytes()).unwrap().unwrap();
            assert_eq!(next.memory(), pass.plan().builder().capacity(grown).build().unwrap().memory());
            // The host rebinds with room.
            let plan = next.builder().capacity(grown.max(full)).build().unwrap();
            let mut larger = Memory::new(&engine, &plan);
            let rebound = pass.rebind(plan, larger.refs(), &scenery.buffers(true)).unwrap();
            assert!(rebound.moved.contains(&PassBuffer::Color) && rebound.old.buffer(PassBuffer::Color).is_some());
            pass.write_inputs(larger.upload.bytes_mut()).unwrap();
            larger.write_upstream(&pass, &upstream);
            run(&engine, &pass);
            assert_eq!(pass.status(larger.readback.bytes()).unwrap(), PassStatus::Whole);
            assert!(pass.plan().next_plan(larger.readback.bytes()).unwrap().is_none());
            for (id, whole) in outputs.iter().zip(&whole.1) {
                assert_eq!(difference(&larger.floats(&pass, *id), whole), None, "{id:?} rebound");
            }
            drop((rebound, memory));
        }
    }
    drop((scenery, rasterizer));
    assert_silent(engine);
}

/// A frame with a vertex that is not finite changes nothing: its gradients are zero, and the word that an optimiser may ask
/// says so.
#[test]
fn a_frame_that_is_not_finite_has_no_gradients() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut scenery = Scenery::new(&engine);
    let case = scenery.engines.case();
    let upstream = random_upstream(&case, case.settings.outputs);
    let mut vertices = scenery.engines.vertices();
    for vertex in &mut vertices {
        vertex[3..6].fill(f32::NAN);
    }
    scenery.vertices.write(0, bytemuck::cast_slice(&vertices));
    let plan = rasterizer
        .pass(&scenery.meshes())
        .settings(case.settings.clone())
        .cameras(&case.cameras)
        .lights(Lights::official())
        .inside_planes()
        .gradients(GradientRequest { texels: false, uvs: false, ..GradientRequest::ALL })
        .build()
        .unwrap();
    let mut memory = Memory::new(&engine, &plan);
    let pass = bind(&rasterizer, &plan, &mut memory, &scenery.buffers(true));
    memory.write_upstream(&pass, &upstream);
    run(&engine, &pass);
    assert!(error(pass.status(memory.readback.bytes())).contains("not finite"));
    assert_eq!(memory.whole_word(&pass), 0);
    for id in [PassBuffer::VertexGradients, PassBuffer::Totals, PassBuffer::CornerGradients] {
        let values = memory.floats(&pass, id);
        let wrong = values.iter().position(|&x| x != 0.0);
        assert_eq!(wrong, None, "{id:?}: {:?}", wrong.map(|i| values[i]));
    }
    drop((pass, memory, scenery, rasterizer));
    assert_silent(engine);
}
