// Whether a frame is whole: its lists had room, no list was longer than the device can walk, and every vertex was finite.
// The images and gradients of any other frame mean nothing. The counts are those of `status`: bins' list entries, tiles' list
// entries, cells.
bool is_whole(uvec3 needed, uvec3 room, uint longest, uint longest_walked, uint not_finite) {
    return all(lessThanEqual(needed, room)) && longest <= longest_walked && not_finite == 0u;
}
