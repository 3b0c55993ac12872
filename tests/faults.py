"""Plants faults into a copy of the tree, one by one, and runs the tests that should catch each.

    python3 tests/faults.py                  # all, some minutes each
    python3 tests/faults.py --only sign clip # those whose name has one of the words
    python3 tests/faults.py --target DIR     # with a target folder that has the dependencies compiled and that nothing
                                             # else builds into: cargo takes the copy for the tree itself
    python3 tests/faults.py --check          # whether each text is still there, without planting
    python3 tests/faults.py --trust          # without running the tests on the whole tree first

Prints a row for each; the exit code is 1 where a fault survives.
"""

import argparse
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
FRAGMENT, FORWARD = "glsl/common/fragment.glsl", "glsl/forward.comp"
SOFT, WALK = "glsl/forward_soft.comp", "glsl/common/walked_tile.glsl"
PAIR, PIXELS = "glsl/common/pair_gradient.glsl", "glsl/common/pair.glsl"
ROWS = "glsl/common/item_pixels.glsl"

# Each fault: what is broken, the file, the text, its replacement, and the tests that should see it. These are a module of
# `cargo test --test quick`. With `unit ` or `fit-unit ` before it, it is a unit test of the library or of softras-fit, with `fit `, `io `, `check `, `cli `
# or `view ` one of that package's tests. With `full ` it needs the full tier's sizes to see the fault, with `layers ` the validation layers.
FAULTS = [
    ("large images copied by no thread but the others", "src/renderer/pixels.rs", "        run();\n", "", ["unit renderer::pixels"]),
    ("memory of an image of another size", "src/renderer/pixels.rs", "one.len() == count", "one.len() > 0", ["unit renderer::pixels"]),
    ("a frame whose images were taken is not saved", "src/renderer/frame.rs", '("color", self.color.take()),',
     '("color", self.owner.take().and(self.color.take())),', ["gradient::living"]),
    ("features before a composite background", "glsl/common/features.glsl", "float blend = COMPOSITE ? alpha_of(p, triangle_count) : 1.0;",
     "float blend = 1.0;", ["gradient::features::three_features"]),
    ("features that a walk forgets", WALK, "feature_sums[i][k] = uintBitsToFloat(", "feature_sums[i][k] = 0.0 * uintBitsToFloat(",
     ["gradient::features::features_do_not_depend"]),
    ("features at the near plane", "glsl/triangle_grad.comp", "dot(by_features, to - from)", "dot(by_features, from - to)",
     ["gradient::features::any_number"]),
    ("a gradient at the near plane without its colours", "src/frame/plan/backward.rs", "let cut = (w.positions || w.camera) &&",
     "let cut = false &&", ["gradient::agreement::each_gradient_alone"]),
    ("fronts that are hidden", "crates/softras-view/src/facing.rs", "*single && !fronts[*t]", "*single && fronts[*t]",
     ["view facing::tests::single"]),
    ("normals away from the viewer", "crates/softras-view/src/facing.rs", "lean(front, triangle) < -LEAN", "lean(front, triangle) < -9.0",
     ["view facing::tests::normals"]),
    ("backs before fronts", "crates/softras-view/src/facing.rs", "(p + BEHIND * sight)", "(p - BEHIND * sight)",
     ["cli render::each_side"]),
    ("a surface that its winding breaks", "crates/softras-view/src/crease.rs", "(a ^ b ^ u32::from(is_turned)) & 1", "(a ^ b) & 1",
     ["view crease::tests::winding"]),
    ("panes of one layer that overlap", "crates/softras-view/src/panes.rs", "(q - p).perp_dot(*r - p) <= most", "(q - p).perp_dot(*r - p) <= 1e9",
     ["view panes::tests"]),
    ("glass blended from the farthest", "crates/softras-view/src/layers.rs", "a.0.total_cmp(&b.0)", "b.0.total_cmp(&a.0)",
     ["cli transparency::panes"]),
    ("glass that cuts out", "crates/softras-view/src/layers.rs", "(seen - opaque) as f32 > GLASS", "(opaque - opaque) as f32 > GLASS",
     ["cli transparency::panes"]),
    ("pictures of the soft model", "crates/softras-view/src/options.rs", "!floats && !asked_soft", "false && !asked_soft",
     ["cli render::specks"]),
    ("glTF: sides the other way round", "crates/softras-io/src/gltf/mod.rs", "!self.pieces[piece].look.is_double_sided", "self.pieces[piece].look.is_double_sided",
     ["io found::materials_of_gltf"]),
    ("parts inside out that are not told", "crates/softras-fit/src/solid/voxel.rs", "least < 0 && most > 0", "least < 0 && most > 9",
     ["fit voxels::parts_that"]),
    ("remeshing that leaves the surface", "crates/softras-fit/src/mesh/remesh/surface.rs", "(self.positions[v], self.sizes[v]) = (point, size);",
     "(self.positions[v], self.sizes[v]) = (0.5 * (self.positions[v] + point), size);", ["fit remesh::no_detail"]),
    ("a view matrix of rank 2", "src/scene/camera.rs", "if x.cross(y).dot(z).abs() < 1e-9 {", "if x == DVec3::ZERO {", ["unit a_view_matrix"]),
    ("a sheared view matrix", "src/scene/camera.rs", "abs_diff_eq(DMat3::IDENTITY, 1e-3)", "abs_diff_eq(DMat3::IDENTITY, 0.5)", ["unit a_view_matrix"]),
    ("a camera straight above without up", "src/scene/camera.rs", "if e.cos().abs() < 1e-6 {", "if false {", ["unit straight_above"]),
    ("a third triangle at an edge left out", "crates/softras-fit/src/mesh/topology.rs", "(i + 1..sides.len())", "(i + 1..2.min(sides.len()))",
     ["fit gradients::regularizers_have_the_values"]),
    ("normals of triangles that run the same way", "crates/softras-fit/src/optimize/regularizer/normals.rs", "{ -1.0 } else { 1.0 }", "{ 1.0 } else { 1.0 }",
     ["fit gradients::regularizers_have_the_values"]),
    ("edges flipped across creases", "crates/softras-fit/src/mesh/remesh/surface.rs", "let smooth = !self.is_kept || old.contains(&DVec3::ZERO) || alike(old[0], old[1]);",
     "let smooth = true;", ["fit remesh::creases"]),
    ("boundaries that are pulled inwards", "crates/softras-fit/src/mesh/subdivision.rs", "2 => toward(&boundary[v], 1.0 / 8.0),",
     "2 => toward(topology.neighbors(v), 1.0 / 8.0),", ["fit subdivision::a_boundary"]),
    ("weights of a vertex as if six met everywhere", "crates/softras-fit/src/mesh/subdivision.rs", "n => 3.0 / (8.0 * n as f64),",
     "_ => 1.0 / 16.0,", ["fit subdivision::the_weights"]),
    ("a cut that leaves the film over a hole", "crates/softras-fit/src/solid/carved.rs", "value.min(if *inside", "(grid.values[i] + far).min(if *inside",
     ["fit carved::a_covered_hole"]),
    ("overlaps that are not counted", "crates/softras-fit/src/solid/voxel.rs", "wrong += usize::from(total == 0 && before != 0 && before != -1);",
     "wrong += usize::from(total == 0 && before > 0);", ["fit carved::parts_that_overlap"]),
    ("edges of one length on any curvature", "crates/softras-fit/src/mesh/remesh/sizing.rs", "if curvature > 0.0 {", "if curvature > 1e30 {",
     ["fit remesh::edges_follow"]),
    ("steps that leave some of the views out", "crates/softras-fit/src/optimize/shape/turn.rs", "(step % views) * count % views",
     "(step % 2) * count % views", ["fit run::steps_of_some"]),
    ("losses of other views compared", "crates/softras-fit/src/optimize/run.rs", "        if self.latest.len() > turn {", "        if self.latest.len() > 1 {",
     ["fit run::steps_of_some"]),
    ("vertices that walk more cells than a loop takes", "src/frame/plan/backward.rs",
     "let walks = vertex_passes(input) <= modes.loop_passes.into();", "let walks = vertex_passes(input) > 0;",
     ["gradient::per_vertex::a_vertex"]),
    ("the stage between chosen by the room for cells", "src/frame/plan/backward.rs",
     "let walks = vertex_passes(input) <= modes.loop_passes.into();",
     "let walks = vertex_passes(input) > 0 && input.forward.push.cell_capacity < 30000;",
     ["gradient::per_vertex::they_do_not"]),
    ("the second of a pair with the tail of the first", "glsl/common/shared_records.glsl",
     "subgroupShuffle(own.shading.xy, shading_lane(is_second))", "subgroupShuffle(own.shading.xy, 0u)", ["render::forward::"]),
    ("two lanes for a tile of a bin, none for another", "glsl/bin_fine.comp", "lane / 2u % 4u;", "lane / 2u % 2u;",
     ["render::properties_images::"]),
    ("a segment with the height of an area", "glsl/common/record.glsl", "(inverse_area < 0.0 ? of_segment : of_point)",
     "(inverse_area < 0.0 ? of_area : of_point)", ["gradient::hazards::"]),
    ("a column short in the rows of a lane", ROWS, "float count = greater(to - from + 1.0, 0.0);",
     "float count = greater(to - from, 0.0);", ["gradient::hazards::"]),
    ("rows cut at the triangle's own edges", ROWS, "reach = 1.001 * reach + 0.01 * frame.scale;", "reach = 0.0;",
     ["gradient::hazards::"]),
    ("pixels of the row below taken twice", ROWS, "next.left = ends ? greater(p.below.y - over, 0.0) : p.left - float(count);",
     "next.left = ends ? p.below.y : p.left - float(count);", ["gradient::hazards::"]),
    ("sign of a vertex's pull", PAIR, "float pull = inside ? -2.0 * LN2 * by_x", "float pull = inside ? 2.0 * LN2 * by_x",
     ["gradient::hazards::"]),
    ("clamp of barycentrics left out", FRAGMENT, "return vec3(lesser(greater(b.x, 1e-20), 1.0),",
     "return vec3(greater(b.x, 1e-20),", ["render::needles::clipped"]),
    ("last triangle of a tile missing", SOFT, "uint all = 0xffffffffu >> uint(from + int(WORD_BITS) - stop);",
     "uint all = (0xffffffffu >> uint(from + int(WORD_BITS) - stop)) >> 1u;", ["render::forward::random_scenes"]),
    ("tile lists one tile short", "glsl/common/tile_mask.glsl", "int(floor(greater(to, -1.0))));",
     "int(floor(greater(to, -1.0))) - 1);", ["render::properties_images::bins"]),
    ("bins one short", "glsl/triangle.comp", "bool ends_row = at.x == bins.z;",
     "bool ends_row = at.x >= max(bins.z, 1) - 1;", ["render::properties_images::bins"]),
    ("barrier between stages dropped", "src/frame/passes/mod.rs", "        recorder.barrier();\n        recorder.end_label();\n",
     "        recorder.end_label();\n", ["layers embed::ash_example::images_are_the_simple_apis"]),
    ("barrier of a sum dropped", "glsl/reduce.comp", "        barrier();\n        if (lane < width)",
     "        if (lane < width)", ["gradient::repeat::", "gradient::agreement::random_scenes"]),
    ("clipped at the wrong plane", "glsl/triangle.comp", "    vec2 near = vec2(frame.near_high, frame.near_low);\n    ViewPoint",
     "    vec2 near = vec2(1.05 * frame.near_high, 0.0);\n    ViewPoint", ["render::properties_images::what_near_cuts"]),
    ("u and v swapped", "glsl/common/sample.glsl", "vec2 at = vec2(folded.x, 1.0 - folded.y)",
     "vec2 at = vec2(folded.y, 1.0 - folded.x)", ["modes::every_pair_of_choices_agrees"]),
    ("gamma missing in a gradient", "glsl/backward.comp", "-frame.score_high * LN2", "-LN2",
     ["gradient::agreement::random_scenes"]),
    ("weights beyond a float's integers in the soft kernel", "src/frame/plan/modes.rs",
     "const LARGEST_SOFT_WEIGHT: f64 = 4_194_304.0;", "const LARGEST_SOFT_WEIGHT: f64 = 1e30;",
     ["render::forward::log_weights"]),
    ("colours summed in the weights' unit", SOFT, "const float COLOR_UNIT = 1048576.0;",
     "const float COLOR_UNIT = 1152921504606846976.0;", ["check found::the_brightest"]),
    ("stale bits of the frame before", "src/frame/passes/forward.rs", "    clear(recorder, bin_bits, plan.sizes[BufferId::BinBits])?;\n",
     "    let _ = bin_bits;\n", ["embed::ash_example::images_are_the_simple_apis"]),
    ("half of a sum's lanes lost", "glsl/reduce.comp", "for (int width = LANES / 2;", "for (int width = LANES / 4;",
     ["gradient::agreement::random_scenes"]),
    ("composite background by alpha", "glsl/common/images.glsl", "background * (1.0 - alpha)", "background * alpha",
     ["modes::every_pair_of_choices_agrees"]),
    ("farther triangles weigh more", FORWARD, "(c.exponent - p.exponent)", "(p.exponent - c.exponent)",
     ["modes::every_pair_of_choices_agrees"]),
    ("light from behind", "glsl/common/light.glsl", "sum += color * max(dot(normal, direction), 0.0);",
     "sum += color * abs(dot(normal, direction));", ["modes::every_pair_of_choices_agrees"]),
    ("normals of a mesh's own left out", "glsl/vertex.comp", "is_given(given) ? given :", "false ? given :",
     ["modes::every_pair_of_choices_agrees"]),
    ("gradients through normals of a mesh's own", "glsl/vertex_normal_grad.comp", "area = is_given(given) ? vec3(0.0) : area;",
     "area = area;", ["modes::every_pair_of_choices_agrees"]),
    ("normals of the frame before", "src/frame/pack/update.rs", "changes.note(BufferId::VertexNormals, overwrite(&mut self.normals[own], normals));",
     "overwrite(&mut self.normals[own], normals);", ["render::repeat_frames::a_frame_after_other_normals"]),
    ("parallel edges told apart by their lines", "glsl/common/distance.glsl", "obtuse ? past_corner :", "false ? past_corner :",
     ["gradient::hazards::obtuse"]),
    ("a dropped fragment's pixel read", PIXELS, "g.mean = kept ? g.mean : 0.0;", "g.mean = g.mean;",
     ["gradient::repeat::pixels_beyond"]),
    ("carry of texel sums dropped", "glsl/common/texel_gradient.glsl", "high + (old + low < old ? 1u : 0u)", "high",
     ["gradient::agreement::every_appearance"]),
    ("a large box's first cell twice", "glsl/triangle.comp", "NO_RECORD, i - start + 1u)", "NO_RECORD, i - start)",
     ["gradient::hazards::saturated"]),
    ("front faces by the wrong turn", "glsl/triangle.comp", "(e.orientation < 0.0) != CLOCKWISE_FRONT",
     "(e.orientation > 0.0) != CLOCKWISE_FRONT", ["modes::every_pair_of_choices_agrees"]),
    ("pixel centres half a pixel off", "glsl/common/forward_tile.glsl", "LaneConstants(vec2(first), ", "LaneConstants(vec2(first) + 0.5, ",
     ["modes::every_pair_of_choices_agrees"]),
    ("entry of a walk lost between words", WALK, "uint waiting = entries[from + lane];",
     "uint waiting = entries[from + lane + 1];", ["gradient::room::"]),
    ("thin tiles walked by the wrong kernel", WALK, "walk.thin == DRAWS_THIN", "walk.thin != DRAWS_THIN",
     ["gradient::room::thin"]),
    ("turns of a walk start over", WALK, "resumes && frame.number > 0u", "resumes && frame.number > 1u",
     ["gradient::room::turns"]),
    ("back faces of a walk before front faces", WALK, "walk.phase == FRONT ? own.entries & ~own.away",
     "walk.phase == BACK ? own.entries & ~own.away", ["gradient::room::"]),
    ("first cell of a long box twice", "glsl/backward.comp", "int first = 1 + int(frame.number",
     "int first = int(frame.number", ["gradient::room::"]),
    ("walks left out of a frame", "src/frame/plan/walked_tiles.rs", "needed: wanted && !(has_room && at_once)",
     "needed: wanted && !has_room && !at_once", ["gradient::room::"]),
    ("radius of another tau", "src/scene/settings.rs", "(1.0 / self.tau - 1.0).ln()", "(0.5 / self.tau - 1.0).ln()",
     ["render::support::"]),
    ("background left where triangles were", "glsl/bin_fine.comp",
     "shape.marks_valid && tile_marks[tile] == TILE_BACKGROUND", "shape.marks_valid",
     ["check found::a_tile_that_a_triangle_has_left"]),
    ("an eighth is next to nothing", "glsl/common/hidden.glsl", "NEXT_TO_NOTHING = -24.0", "NEXT_TO_NOTHING = -3.0",
     ["render::forward::random_scenes"]),
    ("both pieces of a cut triangle in full", "glsl/common/images.glsl",
     "alpha = min(alpha / float(max(triangle_count, 1)), 1.0);", "alpha = alpha / float(max(triangle_count, 1));",
     ["check drawn::the_pieces"]),
    ("gradients of a sum beyond 1", "glsl/pixel_grad.comp", "sums.aggregate > count ? 0.0 : up_alpha / count", "up_alpha / count",
     ["check drawn::the_pieces"]),
    ("opacity left out of the others' product", PAIR, "LEAST_APART && own > g.least ? g.least / own : 1.0", "1.0",
     ["modes::every_pair_of_choices_agrees"]),
    # Faults of the Rust side, in code whose tests need no device.
    ("rounding of the layers' sums kept", "glsl/common/pixel.glsl", "precise float term = word - excess * keep;",
     "precise float term = word;", ["robustness::layers::"]),
    ("faint layers rounded beside 1", SOFT, "w[i].growth += w[i].growth * d[i].e + d[i].e;",
     "w[i].growth = (1.0 + w[i].growth) * (1.0 + d[i].e) - 1.0;", ["robustness::layers::"]),
    ("mesh: an index of the count", "src/scene/mesh.rs", "i as usize >= count", "i as usize > count",
     ["robustness::errors::meshes"]),
    ("settings: near may be far", "src/scene/settings.rs", "self.near * (1.0 + 1e-6), 1e12",
     "self.near, 1e12", ["robustness::errors::scenes_lights"]),
    ("plan: one workgroup short", "src/frame/plan/mod.rs", "n.div_ceil(c::LINEAR_GROUP)", "(n / c::LINEAR_GROUP)",
     ["unit frame::plan::tests::properties::plans"]),
    ("plan: views on top of each other", "src/frame/plan/mod.rs", "record_base: t.records as u32", "record_base: 0",
     ["unit frame::plan::tests::properties::plans"]),
    ("plan: no room for second pieces", "src/frame/plan/mod.rs", "if clips(input) { 2 } else { 1 }",
     "if clips(input) { 1 } else { 1 }", ["unit frame::plan::tests::properties::plans"]),
    ("plan: twice what 32 bits index", "src/frame/plan/mod.rs", "if needed <= limit {", "if needed <= 2 * limit {",
     ["embed::ash_example::records_beyond"]),
    ("support: tau twice", "src/scene/support.rs", "Background::Composite => self.tau / 2.0",
     "Background::Composite => self.tau", ["render::support::"]),

    # Faults of the host's side: reading and writing files, fitting, planning and recording.
    ("optimizer: no momentum", "crates/softras-fit/src/optimize/optimizer.rs", "*m = momentum * *m + g;", "*m = *g;",
     ["fit optimizers::steps_are_those"]),
    ("optimizer: bias of the square kept", "crates/softras-fit/src/optimize/optimizer.rs", "((*v / c2).sqrt() + epsilon)", "(v.sqrt() + epsilon)",
     ["fit optimizers::steps_are_those"]),
    ("optimizer: restored without its steps", "crates/softras-fit/src/optimize/optimizer.rs", "            self.steps = *steps;\n",
     "            let _ = steps;\n", ["fit optimizers::a_saved_optimizer"]),
    ("schedule: the last step not reached", "crates/softras-fit/src/optimize/schedule.rs", "steps.saturating_sub(1).max(1)", "steps.max(1)",
     ["fit optimizers::schedules"]),
    ("pooling: one sample's weight for all", "crates/softras-fit/src/optimize/image_loss.rs", "data[at] += image.data[fine] * share",
     "data[at] = image.data[fine] * share", ["fit gradients::pooling"]),
    ("voxels: crossings of one sense", "crates/softras-fit/src/solid/voxel.rs", "sides.iter().all(|s| *s < 0.0)", "sides.iter().all(|s| *s < -1e30)",
     ["fit voxels::"]),
    ("polygon: a normal's side ignored", "crates/softras-io/src/polygon.rs", "if normal[axis] < 0.0 { -1.0 } else { 1.0 }",
     "if normal[axis] < -1e30 { -1.0 } else { 1.0 }", ["io obj::geometry::polygons"]),
    ("obj: -1 is the last but one", "crates/softras-io/src/obj/parse.rs", "checked_sub(index.unsigned_abs())?", "checked_sub(index.unsigned_abs() + 1)?",
     ["io obj::geometry::negative"]),
    ("obj: a texture named as a picture", "crates/softras-io/src/obj/write.rs", "{stem}_texture{}.png", "{stem}{}.png",
     ["io obj::written::a_texture_is_not_named"]),
    ("obj: clamped textures repeat", "crates/softras-io/src/obj/write.rs", 'wrap() == Wrap::Clamp { "-clamp on " }',
     'wrap() == Wrap::Clamp { "" }', ["io obj::written::writing_and_reading"]),
    ("views: an order of all of them is ignored", "crates/softras-io/src/views/mod.rs", "views.iter().copied().eq(0..self.cameras.len())",
     "views.len() == self.cameras.len()", ["io views::some_views"]),
    ("fit: views held out are not numbered anew", "crates/softras-fit/src/photographs/subject.rs", "self.held_out.contains(&views[*at])",
     "self.held_out.contains(at)", ["fit doubt::a_wrong_view"]),
    ("fit: the edges of a large mesh outweigh the images", "crates/softras-fit/src/fit/setup.rs", "|(_, weight)| *weight *= share", "|(_, weight)| *weight *= 1.0",
     ["fit run::the_sum_over"]),
    ("fit: nothing ends the judging", "crates/softras-fit/src/fit/mod.rs", "is_broken |= told(Event::Progress(at)).is_break() && !self.is_stopped;",
     "is_broken |= told(Event::Progress(at)).is_break() && self.is_stopped;", ["fit run::a_fit_can_be_broken"]),
    ("views: nothing is told of pictures that were turned", "crates/softras-io/src/views/camera_files/mod.rs", "(height, width)) == Some(true)",
     "(height, width)) == None", ["io cameras::pictures_that_were_turned"]),
    ("fit: few views to the end", "crates/softras-fit/src/fit/setup.rs", "steps_of(FEW_UNTIL, iterations),", "iterations,",
     ["fit run::large_steps"]),
    ("fit: few of too few views", "crates/softras-fit/src/fit/setup.rs", "views >= 2 * FEW", "views >= FEW", ["fit run::large_steps"]),
    ("fit: all of very many views in the last steps", "crates/softras-fit/src/fit/setup.rs", "views > 2 * MANY", "views > 9 * MANY",
     ["fit-unit fit::setup"]),
    ("hull: views that are not asked though they tell", "crates/softras-fit/src/solid/hull.rs", "1.001 * views[view].steepest", "0.4 * views[view].steepest",
     ["fit-unit solid::hull::tests::views"]),
    ("hull: a view in another unit is asked too seldom", "crates/softras-fit/src/solid/hull.rs", "of_view * stretch", "of_view",
     ["fit-unit solid::hull::tests::views"]),
    ("views: rows are kept a pixel short", "crates/softras-io/src/views/kept.rs", "|last| last + 1", "|last| last",
     ["io views::pictures_are_cropped"]),
    ("a next plan with no more room", "src/embed/pass/builder.rs", "self.with_room(capacity, self.builder.rare)",
     "self.with_room(self.frame.capacity.max(Capacity { list: 0, ..capacity }), self.builder.rare)", ["embed::facade_status"]),
    ("fit: nobody ends it", "crates/softras-fit/src/work.rs", "self.is_stopped |= (self.told)(event).is_break();",
     "let _ = (self.told)(event);", ["fit photos::a_fit_tells"]),
    ("views: a crop has the camera of the whole picture", "crates/softras-io/src/views/photograph.rs", "x * (cx - left)", "x * cx",
     ["io views::pictures_are_cropped"]),
    ("views: what lies beyond a border is background", "crates/softras-io/src/views/photograph.rs", "if self.is_cut() { corner.clamp", "if false { corner.clamp",
     ["io views::pictures_are_cropped"]),
    ("views: picture 10 comes before picture 9", "crates/softras-io/src/views/files.rs", "pictures.sort_by_cached_key(|path| numbered(path));",
     "pictures.sort();", ["io cameras::pictures_show"]),
    ("views: masks go with pictures in the order of bytes", "crates/softras-io/src/views/files.rs", "order.sort_by_cached_key(|at| numbered(pictures[*at]));",
     "order.sort_by_cached_key(|at| pictures[*at].to_path_buf());", ["io views::the_second_picture"]),
    ("views: a focal length is not scaled with its picture", "crates/softras-io/src/views/camera_files/mod.rs", "(*fx * along, *cx * along, *skew * along)",
     "(*fx, *cx * along, *skew * along)", ["io views::a_picture_of_half_the_size"]),
    ("views: 32 bits are too few for a camera", "crates/softras-io/src/views/camera_files/mod.rs", "const ROUNDING: f64 = 1e-5;", "const ROUNDING: f64 = 0.0;",
     ["io cameras::pictures_show"]),
    ("views: masks as shown lie as stored", "crates/softras-io/src/picture_file.rs", "Orientation::NoTransforms => mask.apply_orientation(back),", "",
     ["io views::masks_lie"]),
    ("views: the alpha of masks is not seen", "crates/softras-io/src/views/masks.rs", "if least < 255 && most > 0 {", "if false {",
     ["io views::masks_are_read"]),
    ("views: a cloth is the object", "crates/softras-io/src/views/surface.rs", "(least < SHALLOWEST * most).then_some(valley as u8)", "None",
     ["io views::a_second_surface"]),
    ("views: shadows are the cloth", "crates/softras-io/src/views/surface.rs", "*distance <= reach && is_beside()", "*distance <= reach",
     ["io views::a_second_surface"]),
    ("held-out views from opposite sides", "crates/softras-fit/src/fit/options.rs", "f64::max(farthest - ASIDE, OPPOSITE)));", "f64::MAX));",
     ["fit photos::views_that_are_held"]),
    ("views: backgrounds of one brightness", "crates/softras-io/src/views/background.rs", "if plain.differs(&border, 0.5) > 0.0 {", "if false {",
     ["io views::plain"]),
    ("masks that cannot be right are fitted", "crates/softras-fit/src/photographs/agreement.rs", "if open > MOST_OPEN {", "if open > 9.0 {", ["fit doubt::masks_that"]),
    ("views: a cut picture is complete", "crates/softras-io/src/views/photograph.rs", "own < all && at == own as usize", "own > all && at == own as usize",
     ["io views::pictures_of_several_sizes"]),
    ("glTF: charts of single triangles have mipmaps", "crates/softras-io/src/gltf/write.rs", "&textures[i], !are_single", "&textures[i], true || are_single",
     ["io formats::charts_of_single"]),
    ("files: permissions not kept", "crates/softras-io/src/output.rs", "file.as_file().set_permissions(existing.permissions())?",
     "drop(existing)", ["io obj::written::links"]),
    ("a built-in mesh has texels in linear light", "crates/softras-io/src/named.rs", "texel.map(decode)", "texel.map(|x| x)",
     ["io named::a_built_in_mesh"]),
    ("every name is near", "crates/softras-io/src/named.rs", "strsim::jaro(name, &own) >= SIMILAR", "strsim::jaro(name, &own) >= 0.0",
     ["io named::a_name_of_nothing"]),
    ("files: litter stays", "crates/softras-io/src/output.rs", "age > LITTER_AGE", "age > LITTER_AGE * 1000", ["io obj::written::litter"]),
    ("files: one name for all writers", "crates/softras-io/src/output.rs", ".rand_bytes(12)", ".rand_bytes(0)", ["io obj::written::two_writers"]),
    ("mesh: positions too far", "src/scene/mesh.rs", "x.abs() > Mesh::FARTHEST", "x.abs() > 2.0 * Mesh::FARTHEST",
     ["robustness::errors::meshes_end"]),
    ("mesh: too few colours", "src/scene/mesh.rs", "if got == expected {", "if got <= expected {", ["robustness::errors::meshes"]),
    ("camera: any angle of view", "src/scene/camera.rs", "(1e-6..std::f64::consts::PI - 1e-6)", "(1e-6..std::f64::consts::TAU)",
     ["robustness::errors::cameras"]),
    ("light: one direction too many", "src/scene/light.rs", "self.directional.len() > Self::MAX_DIRECTIONAL",
     "self.directional.len() > Self::MAX_DIRECTIONAL + 1", ["robustness::errors::"]),
    ("recorder: copies may overlap", "src/vulkan/recorder.rs", "source.raw() == target.raw() && overlaps",
     "false && overlaps", ["unit vulkan::tests::misuse::"]),
    ("recorder: dispatch beyond the limit", "src/vulkan/recorder.rs", "if needed > limit {", "if needed > limit && limit == 0 {",
     ["unit vulkan::tests::misuse::"]),
    ("recorder: push constants of any size", "src/vulkan/recorder.rs", "push.len() != kernel.push_constant_bytes as usize",
     "push.len() > 4096 + kernel.push_constant_bytes as usize", ["unit vulkan::tests::misuse::"]),
    ("embed: a frame's buffer anywhere", "src/frame/bindings.rs", "!at.offset().is_multiple_of(*alignment)",
     "!at.offset().is_multiple_of(*alignment / 2)", ["embed::alignment::"]),
    ("embed: a pass's buffer anywhere", "src/embed/pass/memory.rs", "!given.offset().is_multiple_of(needed.alignment)",
     "!given.offset().is_multiple_of(needed.alignment / 2)", ["embed::alignment::"]),
    ("texels at any offset", "src/vulkan/buffer_part.rs", "!self.offset.is_multiple_of(alignment) ||",
     "!self.offset.is_multiple_of(alignment.min(4)) ||", ["embed::alignment::"]),
    ("storage at any offset", "src/vulkan/descriptors.rs", "!buffer.offset().is_multiple_of(alignment.max(1))",
     "!buffer.offset().is_multiple_of(alignment.min(1))", ["embed::alignment::"]),
    ("hull: half of the tetrahedra turned over", "src/shapes/level_set.rs", "if path < 3 { [first, second] } else { [second, first] }",
     "[first, second]", ["fit hull::"]),
    ("hull: the last picture alone", "crates/softras-fit/src/solid/hull.rs", "least = least.min((distance + slack) as f32);", "least = (distance + slack) as f32;",
     ["fit hull::"]),
    ("depths: the outline not pulled", "crates/softras-fit/src/optimize/shape/compare.rs", "*g *= -means[i / samples]", "*g *= 0.0 * means[i / samples]",
     ["fit surface::"]),
    ("normals: unknown ones compared", "crates/softras-fit/src/optimize/shape/compare.rs", "given && *a >= COVERED", "given && *a >= 0.0",
     ["fit surface::"]),
    ("renderer: a living frame is overwritten", "src/renderer/slot.rs", "Arc::strong_count(&self.owner) == 1",
     "Arc::strong_count(&self.owner) <= 2", ["gradient::living::"]),
    ("renderer: living frames take no memory", "src/renderer/shared.rs", "unwrap_or(u64::MAX).saturating_sub(taken)", "unwrap_or(u64::MAX)",
     ["gradient::living::living_frames_count"]),
    ("renderer: many slots for ever", "src/renderer/mod.rs", "let recently = self.rendered", "let recently = (self.rendered / 1000)",
     ["gradient::living::memory_follows"]),
    ("renderer: moved inputs are not uploaded", "src/renderer/memory.rs", "!(kept[place.1] && before.places.contains(place))", "!kept[place.1]",
     ["gradient::living::", "render::repeat_frames::"]),
    ("renderer: commands of other numbers are kept", "src/renderer/commands.rs", "self.recorded == Some((push, timed))",
     "self.recorded.is_some_and(|(_, times)| times == timed)", ["render::repeat_frames::"]),
    ("renderer: a plan of other depths is kept", "src/embed/pass/own.rs", "*depth_span == shape.depth_span", "shape.views > 0",
     ["render::repeat_frames::a_camera_that"]),
    ("validation: every message accepted", "src/vulkan/own/validation.rs", "id == *accepted && text.contains(about)",
     "id != *accepted || text.contains(about)", ["unit vulkan::own::validation::"]),
    ("an object file is opened as a driver", "src/vulkan/own/loader.rs", "file[16].max(file[17]) != 3", "file[16].max(file[17]) > 3",
     ["robustness::drivers::a_file"]),
    ("further cells without their kernel", "glsl/triangle.comp", "if (more > 0u || uint(size.x", "if (uint(size.x",
     ["gradient::room::thin"]),
    ("kernels for thin triangles never asked for", "src/frame/status.rs", "thin: had.thin || self.thin_tiles > 0,", "thin: had.thin,",
     ["gradient::room::thin"]),
    ("loops written out once too few", "src/vulkan/specialized/unroll.rs", "let (last, values) = found.values.split_last()",
     "let (last, values) = found.values[..found.values.len() - 1].split_last()", ["render::forward::random_scenes"]),
    ("needles sampled at clipped barycentrics, forward_soft", SOFT, "if (SURFACE_POINT == SURFACE_POINT_CLIP) {", "if (true) {",
     ["render::needles::"]),
    ("needles sampled at clipped barycentrics, forward", FRAGMENT, "SURFACE_POINT == SURFACE_POINT_NEAREST && DISTANCE != DISTANCE_HARD",
     "false", ["modes::every_pair_of_choices_agrees"]),
    ("no gradient along the nearest edge", PAIR, "along -= by_t * n.slope;", "", ["gradient::agreement::", "modes::"]),
    ("no gradient by the turn of the nearest edge", PAIR, "by_t * n.slope * n.slope", "0.0 * by_t * n.slope", ["gradient::agreement::", "modes::"]),
    ("host gradients overwritten by the next mesh", "src/embed/pass/mod.rs", "Overlap::Elements if *by == other.step.by => shared = true",
     "Overlap::Elements if *by == other.step.by => {}", ["embed::misuse::meshes"]),
    ("host gradients of vertices that no draw reads", "glsl/place_vertex_grad.comp", "if (!drawn) {", "if (false) {", ["embed::misuse::meshes"]),
    ("host gradients added to the frame before", "src/embed/pass/mod.rs", "record_use(recorder, c::TARGET_CLEAR)", "record_use(recorder, c::TARGET_ADD)",
     ["embed::misuse::meshes"]),
    ("host gradients in the pass's own memory", "src/embed/pass/mod.rs", "if overlaps(workspace, target) {", "if false {", ["embed::misuse::buffers"]),
    ("a frame without a setup", "src/embed/pass/mod.rs", "self.recorded.load(Ordering::Relaxed) >= recorded", "true", ["embed::misuse::orders"]),
    ("gradients by other numbers than the frame's", "src/embed/pass/mod.rs", "*recorded = (*recorded).min(SETUP);", "*recorded = *recorded;",
     ["embed::misuse::orders"]),
    ("a store of another pass", "src/embed/pass/image_store.rs", "if !Arc::ptr_eq(&image.frame, &self.frame.identity) {", "if false {", ["embed::misuse::orders"]),
    ("a foreground over an old background", "src/embed/pass/image_store.rs", "background: self.plan.frame.background()", "background: [0.0; 3]",
     ["embed::misuse::what_changes"]),
    ("a radius of support that stays as it was planned", "src/embed/pass/rebind.rs", "self.frame.shape.cutoff = cutoff;", "",
     ["embed::misuse::what_changes"]),
    ("a scene that crosses a plane of the plan", "src/embed/pass/scene.rs", "if planned.or(shape.depth_span) != planned {", "if false {",
     ["embed::scene::a_scene_of"]),
    ("a scene of other triangles", "src/frame/pack/update.rs", "own == triangles", "own.len() == triangles.len()", ["embed::scene::a_scene_of"]),
    ("a scene of which everything is copied", "src/embed/pass/scene.rs", "filter(|copy| changes.has(copy.id))", "filter(|_| true)",
     ["embed::scene::a_changed"]),
    ("a scene that a new plan forgets", "src/embed/pass/scene.rs", "plan.builder.content = Content::Scene(Some(Arc::new(scene)));", "drop(scene);",
     ["embed::scene::a_changed"]),
    ("lights that stay as they were planned", "src/embed/pass/rebind.rs", "self.frame.shape.lights = lights;", "drop(lights);", ["embed::misuse::what_changes"]),
    ("near that stays when matrices change", "src/embed/pass/rebind.rs", "self.builder.resolved(&self.builder.settings, cameras())?",
     "self.builder.resolved(&self.settings, cameras())?", ["embed::misuse::planes"]),
    ("host indices that leave their mesh", "glsl/place_indices.comp", "index = min(index, uint(draw.vertices) - 1u);", "", ["embed::misuse::indices"]),
    ("gradients of the wrong readback", "src/embed/pass/gradients.rs", "map(|(at, size)| at as usize..(at + size) as usize)",
     "map(|(at, size)| at as usize + 16..(at + size) as usize)", ["embed::misuse::gradients"]),
    ("a GPU that fuses products and sums", "src/vulkan/specialized/mod.rs", "if depth == Depth::Cut {", "if false {",
     ["unit vulkan::specialized::"]),
    ("fit: specks of a hull stay", "crates/softras-fit/src/mesh/specks.rs", ".fold(0.0, f64::max).min(SPECK_EDGES", ".fold(0.0, f64::min).min(SPECK_EDGES",
     ["fit-unit mesh::specks::"]),
    ("views: a soft shadow is the object", "crates/softras-io/src/views/shadow.rs", "<= STEP && has_hue(&cells[beside])", "<= 0.0 * STEP && has_hue(&cells[beside])",
     ["io views::soft_shadows"]),
    ("views that do not agree are kept", "crates/softras-fit/src/photographs/agreement.rs", "is_worse.then_some(at)", "(false && is_worse).then_some(at)",
     ["fit doubt::a_wrong_view"]),
    ("a right view is left out", "crates/softras-fit/src/photographs/agreement.rs", "Some(carver) => covered[carver] = true,", "Some(_) => {}",
     ["fit doubt::a_wrong_view"]),
    ("holes that two pictures show are filled", "crates/softras-fit/src/photographs/agreement.rs", "through[view][*at] <= needed", "through[view][*at] <= 999",
     ["fit doubt::a_hole"]),
    ("a close-up tells the object's size", "crates/softras-fit/src/photographs/cameras.rs", "if x == 0 || y == 0 || x + 1 == width || y + 1 == height {",
     "if false {", ["fit doubt::close_ups"]),
    ("a close-up's border carves", "crates/softras-fit/src/solid/hull.rs", "if self.is_cut && !is_inside {", "if false {", ["fit doubt::close_ups"]),
    ("files: pictures lie as they are stored", "crates/softras-io/src/picture_file.rs", "picture.apply_orientation(self.orientation);", "",
     ["io found::pictures_are_turned"]),
    ("files: a lens that bends the other way", "crates/softras-io/src/views/camera_files/mod.rs", "1.0 + square * (k1",
     "1.0 - square * (k1", ["io found::masks"]),
    ("files: a mesh far from 0 in 32 bits", "crates/softras-io/src/source.rs", "if !(size > 0.0 && far > FAR * size && far.is_finite()) {",
     "if true {", ["io found::a_mesh_far"]),
    ("files: edges of a texture taken from another piece", "crates/softras-io/src/gltf/image.rs",
     "let reach = if edges[0] == edges[1] { &[][..] } else { range.as_flattened() };",
     "let reach = &[][..];", ["io found::edges"]),
    ("files: a length of KTX2 believed", "crates/softras-io/src/texture.rs", "unpacked <= BLOCK * blocks", "unpacked > 0 || blocks > 0",
     ["io found::ktx2"]),
    ("files: an STL file without colours is black", "crates/softras-io/src/stl.rs", "Some(_) => has_words && word & 0x8000 == 0", "Some(_) => word & 0x8000 == 0",
     ["io formats::found::stl_files_without"]),
    ("files: rounded white is taken for bytes", "crates/softras-io/src/color.rs", "x >= 2.0 * BRIGHT", "x > 1.0", ["io formats::found::colours_are_divided"]),
    ("files: 16-bit colours up to 255 are black", "crates/softras-io/src/color.rs", "if greatest <= usual { usual.min(most) }", "if greatest < 0.0 { usual.min(most) }",
     ["io formats::found::colours_are_divided"]),
    ("files: texnumber -1 is the first image", "crates/softras-io/src/ply/mod.rs", "if row.values[3] >= 0.0 {", "if row.values[3] >= -1.0 {",
     ["io formats::found::names_and_rows"]),
    ("files: one bad point loses the file", "crates/softras-io/src/source.rs", "if is_good.contains(&false) {", "if false && is_good.contains(&false) {",
     ["io obj::refused::what_can_be_left_out_of_a_mesh"]),
    ("files: one bad index loses the file", "crates/softras-io/src/gltf/mod.rs", "|&corner| (corner as usize) < count)", "|&corner| (corner as usize) <= count)",
     ["io formats::what_is_wrong_in_a_file"]),
    ("files: a normal of nothing is not noted", "crates/softras-io/src/obj/parse.rs", "if found == Some(None) {", "if found == Some(None) && what != \"normals\" {",
     ["io obj::geometry::what_is_not_drawn"]),
    ("files: a padded JSON chunk is malformed", "crates/softras-io/src/gltf/mod.rs", "&text::decoded(text::unpadded(text))", "&text::decoded(text)",
     ["io formats::found::gltf_files_may_be_padded"]),
    ("files: a pointer is read as a mesh", "crates/softras-io/src/input.rs", 'head.contains("oid sha256:")', 'head.contains("oid sha512:")',
     ["io formats::found::what_stands_in"]),
    ("files: names in Latin-1 are lost", "crates/softras-io/src/text.rs", "map_or_else(|_| bytes.iter().map(|&byte| char::from(byte)).collect()", "map_or_else(|_| String::from_utf8_lossy(bytes)",
     ["io formats::found::names_beyond_ascii"]),
    ("files: rows run on over their lines", "crates/softras-io/src/ply/rows.rs", "lines >= rows && is_text", "false && lines >= rows && is_text",
     ["io formats::found::names_and_rows"]),
    ("files: written normals are lost", "crates/softras-io/src/obj/write.rs", "written.normals_of(t).map(", "written.normals_of(t).filter(|_| false).map(",
     ["io generated::generated_files_pass"]),
    ("files: a mirrored node keeps its winding", "crates/softras-io/src/gltf/mod.rs", "place.determinant() < 0.0", "place.determinant() < -1e30",
     ["io generated::generated_files_are"]),
    ("files: a mesh written at 0 that was read elsewhere", "crates/softras-io/src/lib.rs", "f64::from(position[k]) + origin[k]",
     "f64::from(position[k]) + 0.5 * origin[k]", ["io a_mesh_is_written"]),
    ("a stage without its timestamp", "src/vulkan/recorder.rs", "        *next += 1;", "        *next += u32::from(*next != 7);",
     ["embed::devices::a_hosts_queries"]),
    ("labels without the prefix", "src/vulkan/recorder.rs", "zip(prefix.bytes().chain(name.bytes()))", "zip(name.bytes())",
     ["unit labels_begin"]),
    ("a setup that leaves the tiles' counts", "src/embed/pass/mod.rs", "recorder.fill(counts, 0, counts.range() / 4 * 4, 0)?;",
     "recorder.fill(&counts, 0, 0, 0)?;", ["embed::misuse::gradients_of"]),
    ("bits of vertices by what else is asked for", "src/frame/plan/backward.rs", "    walks && modes.near_clip == 0",
     "    walks && modes.gradients & c::GRADIENT_VIEW == 0 && modes.near_clip == 0", ["gradient::per_vertex::they_have"]),
    ("fragments of the triangle before", "src/renderer/fragments.rs", ".checked_sub(1)", ".checked_sub(2)", ["render::fragments"]),
    ("fragments weighed as on the screen", "src/renderer/fragments.rs", "let w = if flat { 1.0 } else { p.z };", "let w = 1.0;",
     ["render::fragments"]),
    ("held-out views that are fitted", "crates/softras-fit/src/fit/options.rs", "!subject.held_out.contains(view)", "view < &usize::MAX",
     ["fit photos::views"]),
    ("cameras refined the other way", "crates/softras-fit/src/photographs/refine.rs", "gradient + prior * value", "prior * value - gradient",
     ["fit photos::cameras"]),
    ("cameras that never turn", "crates/softras-fit/src/photographs/refine.rs", "if turns { turn } else { DVec3::ZERO }", "DVec3::ZERO",
     ["fit photos::cameras_that_are_turned"]),
    ("colours at their end taken as they are", "crates/softras-fit/src/photographs/exposure.rs", "{ -given }", "{ given }", ["fit photos::colours"]),
    ("holes that meet by chance are believed", "crates/softras-fit/src/photographs/agreement.rs", "PLACES * all * tail > BY_CHANCE", "all < 0.0",
     ["fit doubt::holes"]),
]


def run(command, folder, target, limit, more):
    environment = dict(os.environ, CARGO_TARGET_DIR=str(target), **more)
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               text=True, start_new_session=True)
    try:
        out, errors = process.communicate(timeout=limit)
        return subprocess.CompletedProcess(command, process.returncode, out, errors)
    except subprocess.TimeoutExpired:
        # This stops the test itself too, not cargo alone.
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return None


def cargo(test, arguments):
    """The command for a test by its name in the list, with the words before it that the list explains."""
    words = test.split()
    tier = {"full": {"SOFTRAS_TIER": "full"}, "layers": {"SOFTRAS_VALIDATION": "1"}}.get(words[0], {})
    programs = {name: ["-p", f"softras-{name}", "--test", name] for name in ("fit", "io", "check", "cli")}
    programs |= {"unit": ["-p", "softras", "--lib"], "fit-unit": ["-p", "softras-fit", "--lib"]}
    programs["view"] = ["-p", "softras-view", "--lib"]
    program = programs.get(words[-2] if words[1:] else "", ["-p", "softras", "--test", "quick"])
    return ["cargo", "test", "-q", *program, *arguments], words[-1], tier


def caught_by(folder, target, tests, patient):
    """The first test that fails, or "" where all pass."""
    for test in tests:
        command, name, tier = cargo(test, [])
        by = {"full": "full", "layers": "gate"}.get(test.split()[0], "quick")
        built = run([*command, "--no-run"], folder, target, 1800, {})
        if built is None or built.returncode != 0:
            sys.exit("does not compile: " + (built.stderr[-500:] if built else ""))
        # Frames that never end are caught too.
        ran = run([*command, "--", name], folder, target, patient, tier)
        if ran is None:
            return f"{by}: does not end"
        if "running 0 tests" in ran.stdout:
            sys.exit(f"there is no test named like {name!r}")
        if ran.returncode != 0:
            failed = [line.split()[1] for line in ran.stdout.splitlines() if line.startswith("---- ")]
            return f"{by}: {', '.join(failed[:2]) or 'crashes'}"
    return ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--target", type=pathlib.Path)
    parser.add_argument("--check", action="store_true", help="look for the texts and plant nothing")
    parser.add_argument("--trust", action="store_true", help="do not run the tests without a fault first")
    parser.add_argument("--patience", type=int, default=600, help="seconds for one test")
    arguments = parser.parse_args()
    chosen = [f for f in FAULTS if not arguments.only or any(word in f[0] for word in arguments.only)]
    for what, name, old, _, _ in chosen:
        if (ROOT / name).read_text().count(old) != 1:
            sys.exit(f"{what}: {name} has not one {old!r}")
    if arguments.check:
        print(f"{len(chosen)} faults can be planted")
        return
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch) / "softras"
        files = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for name in files.splitlines():
            if (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        target = arguments.target or folder / "target"
        # Without a fault none of these tests may fail; a test that always fails would catch anything.
        whole = [] if arguments.trust else sorted({test for fault in chosen for test in fault[4]})
        failing = caught_by(folder, target, whole, arguments.patience)
        if failing:
            sys.exit(f"without a fault: {failing}")
        survivors, by_quick = 0, 0
        for what, name, old, new, tests in chosen:
            path = folder / name
            text = path.read_text()
            path.write_text(text.replace(old, new))
            start = time.monotonic()
            outcome = caught_by(folder, target, tests, arguments.patience)
            path.write_text(text)
            survivors += outcome == ""
            by_quick += outcome.startswith("quick")
            print(f"{what:34} {outcome or 'SURVIVES':70} {time.monotonic() - start:5.0f} s", flush=True)
    print(f"{len(chosen)} planted, {by_quick} caught by the quick tier, {len(chosen) - survivors - by_quick} by the gate or the full one")
    sys.exit(survivors > 0)


if __name__ == "__main__":
    main()
