// Weights of the pixels with edges in the listed tiles.

fn marked(tile_x: u32, y: u32) -> u32 {
    let word = bits[y * params.words.x + tile_x];
    return word.x | word.y;
}

fn work(p: vec2<u32>) {
    weigh(vec2<i32>(p));
}
