//! What could break: factors that are not those of the closed forms, light that is lost or made, an
//! error that is larger than is said.

use core::f64::consts::PI;

use radiometry::Tolerance;
use radiometry::form_factor::{
    parallel_disks, perpendicular_rectangles, polygons_occluded, sphere_disk,
};
use radiometry::projected::{Occluder, Receiver};
use spanned_toml::{Document, Source};

use super::*;
use crate::Quantity;

fn scene(text: &str) -> Scene {
    let document = Document::parse(Source::new("scene.toml", text)).unwrap();
    let load = |name: &str| Err(format!("{name}: no such file"));
    Scene::read(&document, Quantity::Radiance, &load).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn surface(albedo: f64, place: &str) -> String {
    format!("[[surface]]\nkind = \"lambertian\"\nalbedo = {albedo}\n{place}\n")
}

const FAR_LAMP: &str = "[[lamp]]\nkind = \"sphere\"\ncentre_mm = [300, 200, 4000]\nradius_mm = 40\n\
                        radiance_w_per_m2_sr = 10\n";

fn lightings(scene: &Scene) -> Vec<Arc<Lighting>> {
    Lighting::all(scene, &|_| true).unwrap()
}

fn exchange(scene: &Scene, accuracy: f64) -> Arc<Exchange> {
    let aim = Aim { accuracy, spot_m2: SPOT_M2 };
    Arc::new(Exchange::new(scene, &lightings(scene), aim).unwrap().expect("no pair"))
}

/// 5 mm wide.
const SPOT_M2: f64 = 2e-5;

fn factor(exchange: &Exchange, from: usize, to: usize) -> f64 {
    let pairs = exchange.pairs();
    pairs.iter().find(|pair| (pair.from, pair.to) == (from, to)).map_or(0.0, |p| p.form_factor)
}

const FLOOR: &str = "x_mm = [0, 100]\ny_mm = [0, 80]";
const WALL: &str = "corners_mm = [[0, 0, 0], [0, 80, 0], [0, 80, 60], [0, 0, 60]]";

#[test]
fn form_factors_are_those_of_the_closed_forms_both_ways() {
    let corner = scene(&format!("{}{}{FAR_LAMP}", surface(0.5, FLOOR), surface(0.5, WALL)));
    let found = exchange(&corner, 1e-3);
    let expected = perpendicular_rectangles(0.1, 0.06, 0.08).unwrap().ratio();
    let back = expected * 0.08 * 0.1 / (0.08 * 0.06);
    let both = (factor(&found, 0, 1), factor(&found, 1, 0));
    let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-6;
    assert!(
        near(both.0, expected) && near(both.1, back) || near(both.1, expected),
        "{both:?} {expected} {back}"
    );
    // Reciprocity: A F is the same both ways.
    assert!((both.0 * 0.1 / (both.1 * 0.06) - 1.0).abs() < 1e-6, "{both:?}");

    let disks = scene(&format!(
        "{}{}{FAR_LAMP}",
        surface(0.5, "radius_mm = 30"),
        surface(0.5, "centre_mm = [10, 0, 40]\naxis = [0, 0, -1]\nradius_mm = 20")
    ));
    let found = factor(&exchange(&disks, 1e-3), 0, 1);
    let tolerance = Tolerance::from_relative(1e-9).unwrap();
    let expected = parallel_disks(0.03, 0.02, 0.04, 0.01, tolerance).unwrap().value;
    assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");

    let ball = scene(&format!(
        "{}{}{FAR_LAMP}",
        surface(0.5, "radius_mm = 30"),
        surface(0.5, "centre_mm = [0, 0, 40]\nradius_mm = 20")
    ));
    let found = factor(&exchange(&ball, 1e-2), 1, 0);
    let expected = sphere_disk(0.02, 0.04, 0.03).unwrap().ratio();
    assert!((found / expected - 1.0).abs() < 3e-4, "{found} {expected}");
}

#[test]
fn what_stands_between_hides_as_much_as_its_cone_does() {
    let ceiling = "corners_mm = [[0, 0, 50], [0, 80, 50], [100, 80, 50], [100, 0, 50]]";
    let lid = "[[occluder]]\nkind = \"polygon\"\n\
               corners_mm = [[30, 20, 25], [90, 25, 25], [85, 60, 25], [35, 50, 25]]\n";
    let both = format!("{}{}{FAR_LAMP}{lid}", surface(0.5, FLOOR), surface(0.5, ceiling));
    let scene = scene(&both);
    let found = factor(&exchange(&scene, 1e-2), 0, 1);
    let polygon = |i: usize| match scene.surfaces()[i].body().solid() {
        Some(crate::scene::Solid::Polygon(polygon)) => polygon,
        other => panic!("{other:?}"),
    };
    let crate::scene::Solid::Polygon(lid) = scene.occluders()[0].clone() else { panic!() };
    let tolerance = Tolerance::from_relative(1e-6).unwrap();
    let between = [Occluder::Polygon(lid)];
    let expected = polygons_occluded(&polygon(0), &polygon(1), &between, tolerance).unwrap().value;
    assert!((found / expected - 1.0).abs() < 5e-3, "{found} {expected}");
}

#[test]
fn a_dark_wall_is_lit_by_an_even_floor_as_the_closed_form_says() {
    // A wall that sends nothing back, a floor of exitance 1: E is the projected solid angle over π.
    let corner = scene(&format!("{}{}{FAR_LAMP}", surface(0.5, FLOOR), surface(1e-12, WALL)));
    let exchange = exchange(&corner, 2e-3);
    let of_floor = |leaf: &usize| exchange.mesh.surface(*leaf) == 0;
    let direct: Vec<OnNodes> = exchange
        .mesh
        .leaves
        .iter()
        .map(of_floor)
        .map(|is_floor| [f64::from(u8::from(is_floor)) * 2.0; NODES])
        .collect();
    let indirect = exchange.settle(&direct).unwrap();
    let lit = Interreflection { exchange: Arc::clone(&exchange), indirect };
    let Some(crate::scene::Solid::Polygon(floor)) = corner.surfaces()[0].body().solid() else {
        panic!()
    };
    for (y, z) in [(0.04, 0.03), (0.02, 0.002), (0.07, 0.0001), (0.0333, 0.0591), (0.04, 1e-6)] {
        let place = DVec3::new(0.0, y, z);
        let receiver = Receiver::new(place, DVec3::X).unwrap();
        let expected = projected::polygon(&receiver, &floor).unwrap().sr() / PI;
        let found = lit.irradiance(1, place);
        assert!((found - expected).abs() < 3e-5, "{found} {expected} at {y} {z}");
    }
}

/// A box 100 x 80 x 60 mm of six surfaces, and a ball that shines in it.
fn cavity(albedos: [f64; 6]) -> Scene {
    let walls = [
        "x_mm = [0, 100]\ny_mm = [0, 80]",
        "corners_mm = [[0, 0, 60], [0, 80, 60], [100, 80, 60], [100, 0, 60]]",
        "corners_mm = [[0, 0, 0], [0, 80, 0], [0, 80, 60], [0, 0, 60]]",
        "corners_mm = [[100, 0, 0], [100, 0, 60], [100, 80, 60], [100, 80, 0]]",
        "corners_mm = [[0, 0, 0], [0, 0, 60], [100, 0, 60], [100, 0, 0]]",
        "corners_mm = [[0, 80, 0], [100, 80, 0], [100, 80, 60], [0, 80, 60]]",
    ];
    let walls: String = walls.iter().zip(albedos).map(|(place, rho)| surface(rho, place)).collect();
    scene(&format!(
        "{walls}[[emitter]]\nkind = \"lambertian\"\ncentre_mm = [40, 45, 30]\nradius_mm = 4\n\
         radiance_w_per_m2_sr = 10\n"
    ))
}

#[test]
fn in_a_closed_box_all_that_is_emitted_is_absorbed() {
    let scene = cavity([0.8, 0.6, 0.3, 0.9, 0.5, 0.7]);
    let exchange = exchange(&scene, 4e-2);
    let lightings = lightings(&scene);
    let lit = exchange.lit(&lightings).unwrap();
    let direct = exchange.direct(&lightings, &mut HashMap::new());
    let Body::Raised(crate::scene::Solid::Sphere(ball)) = scene.emitters()[0].body() else {
        panic!()
    };
    let mut absorbed = 0.0;
    for (leaf, cell) in exchange.mesh.leaves.iter().enumerate() {
        for (k, point) in exchange.mesh.points(*cell).iter().enumerate() {
            let arriving = direct[leaf][k] + lit.indirect[leaf][k];
            let rho = exchange.albedo(leaf);
            // The ball is black and takes its part of what is sent.
            let receiver = Receiver::new(point.place, point.normal).unwrap();
            let to_ball = projected::sphere(&receiver, ball).unwrap().sr() / PI;
            absorbed += point.density_m2 * arriving * ((1.0 - rho) + rho * to_ball);
        }
    }
    let emitted = scene.flux();
    println!(
        "{absorbed} of {emitted}, stated {:e} cells {}",
        exchange.error,
        exchange.mesh.leaves.len()
    );
    assert!((absorbed / emitted - 1.0).abs() < 1e-3, "{absorbed} of {emitted}");
    assert!((absorbed / emitted - 1.0).abs() < exchange.error);
}

#[test]
fn in_a_box_lit_evenly_light_goes_round_as_in_a_sphere() {
    // Without the ball: E = E₀ / (1 - ρ).
    let mut walls = Scene::new(Quantity::Radiance);
    for surface in cavity([0.75; 6]).surfaces() {
        walls.add_surface(surface.clone()).unwrap();
    }
    let exchange = exchange(&walls, 1e-2);
    let direct = vec![[2.0; NODES]; exchange.mesh.leaves.len()];
    let indirect = exchange.settle(&direct).unwrap();
    for e in indirect.iter().flatten() {
        assert!((e + 2.0 - 8.0).abs() < 1e-5, "{e}");
    }
    let mirror = cavity([1.0; 6]);
    let mut closed = Scene::new(Quantity::Radiance);
    for surface in mirror.surfaces() {
        closed.add_surface(surface.clone()).unwrap();
    }
    let exchange = self::exchange(&closed, 1e-1);
    let direct = vec![[2.0; NODES]; exchange.mesh.leaves.len()];
    assert!(exchange.settle(&direct).unwrap_err().to_string().contains("lower an albedo"));
}

#[test]
fn the_stated_error_holds_against_a_finer_solution() {
    let ceiling = "corners_mm = [[10, 0, 50], [10, 80, 70], [80, 80, 70], [80, 0, 50]]";
    let text = format!(
        "{}{}{}[[lamp]]\nkind = \"sphere\"\ncentre_mm = [260, 30, 30]\nradius_mm = 20\n\
         radiance_w_per_m2_sr = 10\n",
        surface(0.8, FLOOR),
        surface(0.6, WALL),
        surface(0.7, ceiling)
    );
    let scene = scene(&text);
    let lightings = lightings(&scene);
    let fine = exchange(&scene, 1e-3);
    let reference = fine.lit(&lightings).unwrap();
    println!("fine: {} cells, {:e}", fine.mesh.leaves.len(), fine.error);
    let mut places = Vec::new();
    for i in 0..6 {
        for k in 0..6 {
            let (u, v) = (f64::from(i) / 5.0, f64::from(k) / 5.0);
            places.push((0, DVec3::new(0.003 + 0.094 * u, 0.003 + 0.074 * v, 0.0)));
            places.push((1, DVec3::new(0.0, 0.003 + 0.074 * v, 0.003 + 0.054 * u)));
        }
    }
    for accuracy in [1e-1, 1e-2] {
        let exchange = exchange(&scene, accuracy);
        let lit = exchange.lit(&lightings).unwrap();
        let mut worst = 0.0_f64;
        for (surface, centre) in places.iter().copied() {
            // As a spot sees it.
            let (mut whole, mut apart) = (0.0, 0.0);
            for (at, weight) in radiometry::beam::disk_rule(9) {
                let body = scene.surfaces()[surface].body();
                let (e, f) = radiometry::direction::frame(body.normal(centre));
                let place = centre + (e * at.x + f * at.y) * libm::sqrt(SPOT_M2 / PI);
                let direct = lightings[surface].irradiance(place, body.normal(place));
                let (found, fine) =
                    (lit.irradiance(surface, place), reference.irradiance(surface, place));
                whole += weight * (direct + fine);
                apart += weight * (found - fine);
            }
            worst = worst.max(apart.abs() / whole);
        }
        println!(
            "{accuracy:e}: {} cells, stated {:e}, found {worst:e}",
            exchange.mesh.leaves.len(),
            exchange.error
        );
        assert!(exchange.error <= accuracy, "{:e}", exchange.error);
        assert!(worst <= exchange.error + fine.error, "{worst:e} {:e}", exchange.error);
    }
}
