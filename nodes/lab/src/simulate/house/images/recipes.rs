//! Recipes of materials for each class.

use super::pattern::Pattern;

/// Ranges that a material is drawn from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recipe {
    pub hue_deg: [f64; 2],
    pub saturation: [f64; 2],
    pub value: [f64; 2],
    pub patterns: &'static [Pattern],
    pub gloss: [f64; 2],
    pub glow: [f64; 2],
}

const ANY: [f64; 2] = [0.0, 360.0];
const MATT: [f64; 2] = [0.0, 0.05];
const DARK: [f64; 2] = [0.0, 0.0];

const fn recipe(
    hue_deg: [f64; 2],
    saturation: [f64; 2],
    value: [f64; 2],
    patterns: &'static [Pattern],
    gloss: [f64; 2],
) -> Recipe {
    Recipe {
        hue_deg,
        saturation,
        value,
        patterns,
        gloss,
        glow: DARK,
    }
}

use Pattern::{Books, Checker, Mottled, Painting, Plain, Stripes, Tiles, Wood};

impl Recipe {
    /// Grey paint.
    pub(super) const GREY: Recipe = recipe(ANY, [0.0, 0.05], [0.4, 0.8], &[Plain], MATT);
}

const PAINT: Recipe = recipe(
    ANY,
    [0.0, 0.25],
    [0.65, 0.95],
    &[Plain, Plain, Mottled],
    MATT,
);
const WARM_PAINT: Recipe = recipe(
    [20., 70.],
    [0.05, 0.3],
    [0.7, 0.95],
    &[Plain, Mottled],
    MATT,
);
const WALLPAPER: Recipe = recipe(ANY, [0.0, 0.3], [0.6, 0.9], &[Stripes, Mottled], MATT);
const WHITE: Recipe = recipe(ANY, [0.0, 0.06], [0.8, 0.95], &[Plain], [0.0, 0.15]);
const LIGHT_WOOD: Recipe = recipe([22., 42.], [0.3, 0.55], [0.6, 0.9], &[Wood], [0.0, 0.15]);
const DARK_WOOD: Recipe = recipe([10., 32.], [0.4, 0.75], [0.25, 0.55], &[Wood], [0.0, 0.2]);
const TILED: Recipe = recipe(
    ANY,
    [0.0, 0.25],
    [0.4, 0.9],
    &[Tiles, Checker],
    [0.05, 0.25],
);
const CARPET: Recipe = recipe(ANY, [0.05, 0.5], [0.3, 0.7], &[Mottled], [0.0, 0.0]);
const SCREEN: Recipe = recipe(ANY, [0.0, 0.3], [0.03, 0.18], &[Plain], [0.2, 0.5]);
const FABRIC: Recipe = recipe(
    ANY,
    [0.1, 0.8],
    [0.25, 0.85],
    &[Mottled, Plain, Checker],
    [0.0, 0.0],
);
const GREY_FABRIC: Recipe = recipe(ANY, [0.0, 0.15], [0.2, 0.7], &[Mottled, Plain], [0.0, 0.0]);
const LINEN: Recipe = recipe(
    ANY,
    [0.0, 0.4],
    [0.7, 0.95],
    &[Plain, Mottled, Stripes],
    [0.0, 0.0],
);
const DRAPERY: Recipe = recipe(
    ANY,
    [0.1, 0.7],
    [0.4, 0.9],
    &[Stripes, Plain, Mottled],
    [0.0, 0.0],
);
const METAL: Recipe = recipe([190., 240.], [0.0, 0.1], [0.5, 0.8], &[Plain], [0.2, 0.5]);
const STONE: Recipe = recipe(ANY, [0.0, 0.2], [0.3, 0.8], &[Mottled], [0.05, 0.3]);
const LACQUER: Recipe = recipe(ANY, [0.2, 0.8], [0.3, 0.9], &[Plain], [0.1, 0.4]);
const LEAVES: Recipe = recipe([80., 150.], [0.4, 0.9], [0.2, 0.6], &[Mottled], [0.0, 0.1]);
const BOOKS: Recipe = recipe([15., 40.], [0.2, 0.7], [0.3, 0.8], &[Books], MATT);
const ART: Recipe = recipe(ANY, [0.2, 0.9], [0.2, 0.9], &[Painting], [0.0, 0.1]);
const PANE: Recipe = Recipe {
    glow: [0.6, 2.5],
    ..recipe(
        [190., 230.],
        [0.05, 0.45],
        [0.8, 1.0],
        &[Plain, Plain, Mottled],
        [0.1, 0.3],
    )
};

/// Recipes of a class by its name; one is drawn for each thing.
pub(super) fn recipes(class: &str) -> &'static [Recipe] {
    match class {
        "wall" => &[PAINT, WARM_PAINT, PAINT, WALLPAPER, WHITE],
        "floor" => &[LIGHT_WOOD, DARK_WOOD, TILED, CARPET, LIGHT_WOOD],
        "ceiling" => &[WHITE, PAINT, WHITE],
        "tv" => &[SCREEN],
        "cabinet" => &[LIGHT_WOOD, DARK_WOOD, WHITE, LACQUER],
        "desk" | "table" => &[LIGHT_WOOD, DARK_WOOD, WHITE],
        "chair" => &[LIGHT_WOOD, DARK_WOOD, FABRIC, GREY_FABRIC, LACQUER],
        "sofa" => &[FABRIC, GREY_FABRIC],
        "bookshelf" => &[BOOKS],
        "counter" => &[STONE, WHITE, LIGHT_WOOD],
        "fridge" => &[METAL, WHITE],
        "bed" => &[LINEN, FABRIC],
        "door" => &[LIGHT_WOOD, DARK_WOOD, WHITE],
        "window" => &[PANE],
        "curtain" => &[DRAPERY],
        "picture" => &[ART],
        _ => &[LACQUER, FABRIC, LEAVES, METAL, STONE, LIGHT_WOOD],
    }
}
