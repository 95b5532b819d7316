//! Form factors against the reference cases, each at its own tolerance, and against the laws that
//! all of them obey.

use glam::{DVec2, DVec3};
use radiometry::form_factor::{self, aligned_rectangles};
use radiometry::quadrature::quasi_monte_carlo;
use radiometry::shape::Polygon;
use radiometry::{Estimate, EstimateError, Tolerance};
use serde_json::Value;

const CASES: &str = include_str!("data/cases-form-factors.jsonl");

#[test]
fn every_reference_case_is_met_and_every_bound_holds() {
    let mut misses = Vec::new();
    let mut met = 0;
    for line in CASES.lines() {
        let case: Value = serde_json::from_str(line).expect("a case is one line of JSON");
        let expected: f64 = case["expected"].as_str().expect("text").parse().expect("a number");
        let relative = case["rel_tol"].as_f64().expect("rel_tol");
        let allowed = case["abs_tol"].as_f64().expect("abs_tol") + relative * expected.abs();
        let said = format!("{} {}", case["id"], case["quantity"]);
        match answer(case["quantity"].as_str().expect("quantity"), &case["inputs"]) {
            Err(error) => misses.push(format!("{said}: {error}")),
            Ok(got) => {
                let error = (got.value - expected).abs();
                if error > allowed {
                    misses.push(format!("{said}: {got:?}, expected {expected:e} ± {allowed:e}"));
                } else if error > got.error_bound + written(got) * expected {
                    misses.push(format!("{said}: off by {error:e}, {got:?}"));
                } else {
                    met += 1;
                }
            }
        }
    }
    assert!(misses.is_empty(), "{} missed:\n{}", misses.len(), misses.join("\n"));
    assert_eq!(met, 109);
}

/// What an exact value of 17 digits may miss; closed forms state no bound of their own but are held to
/// 64 ulp.
fn written(got: Estimate) -> f64 {
    if got.evaluations > 0 { 5e-17 } else { 0.0 }
}

fn answer(quantity: &str, inputs: &Value) -> Result<Estimate, EstimateError> {
    let n = |key: &str| inputs[key].as_f64().unwrap_or_else(|| panic!("{quantity}: {key}"));
    let side = |a: &str, b: &str| [n(a), n(b)];
    let point = |key: &str| {
        let list = &inputs[key];
        DVec2::new(list[0].as_f64().expect(key), list[1].as_f64().expect(key))
    };
    let factor = match quantity {
        "form-factor-coaxial-disks" => form_factor::coaxial_disks(n("r1"), n("r2"), n("h"))?,
        "form-factor-parallel-disks" => {
            let (r1, r2) = (n("r1"), n("r2"));
            return form_factor::parallel_disks(r1, r2, n("h"), n("offset"), Tolerance::FINE);
        }
        "form-factor-parallel-rectangles" => {
            form_factor::parallel_rectangles(n("a"), n("b"), n("c"))?
        }
        "form-factor-perpendicular-rectangles" => {
            form_factor::perpendicular_rectangles(n("w"), n("h"), n("l"))?
        }
        "form-factor-aligned-rectangles" => aligned_rectangles(
            side("x1", "x2"),
            side("y1", "y2"),
            side("xi1", "xi2"),
            side("eta1", "eta2"),
            n("z"),
        )?,
        "form-factor-perpendicular-offset-rectangles" => {
            form_factor::perpendicular_offset_rectangles(
                side("x1", "x2"),
                side("y1", "y2"),
                side("z1", "z2"),
                side("eta1", "eta2"),
            )?
        }
        "form-factor-wedge-rectangles" => {
            let (a, b, l) = (n("a"), n("b"), n("l"));
            return form_factor::wedge_rectangles(a, b, l, n("cos_phi"), Tolerance::FINE);
        }
        "form-factor-sphere-disk" => form_factor::sphere_disk(n("r1"), n("h"), n("r2"))?,
        "form-factor-spheres" => {
            return form_factor::spheres(n("r1"), n("r2"), n("d"), Tolerance::FINE);
        }
        "form-factor-concentric-spheres" => form_factor::concentric_spheres(n("r1"), n("r2"))?,
        "form-factor-parallel-cylinders" => form_factor::parallel_cylinders(n("r"), n("d"))?,
        "form-factor-strips" => {
            form_factor::strips([point("p0"), point("p1")], [point("q0"), point("q1")])?
        }
        "form-factor-polygons" => {
            let tolerance = Tolerance::from_relative(n("relative_tolerance"))?;
            return form_factor::polygons(
                &polygon(&inputs["from"]),
                &polygon(&inputs["to"]),
                tolerance,
            );
        }
        other => panic!("nothing answers {other}"),
    };
    Ok(Estimate::closed(factor.ratio(), 64.0))
}

fn polygon(vertices: &Value) -> Polygon {
    let number = |value: &Value| value.as_f64().expect("a coordinate");
    let vertex = |v: &Value| DVec3::new(number(&v[0]), number(&v[1]), number(&v[2]));
    Polygon::new(vertices.as_array().expect("vertices").iter().map(vertex).collect())
        .expect("a polygon")
}

/// A generator of its own, so that a failure can be run again.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 11) as f64 * 2_f64.powi(-53)
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in [0, count)")]
    fn index(&mut self, count: usize) -> usize {
        (self.next() * count as f64) as usize
    }

    /// Between 10^-power and 10^power.
    fn size(&mut self, power: f64) -> f64 {
        10_f64.powf(power * (2.0 * self.next() - 1.0))
    }

    fn side(&mut self, power: f64) -> [f64; 2] {
        let start = self.next() * self.size(power);
        [start, start + self.size(power)]
    }
}

fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * a.abs().max(b.abs())
}

#[test]
fn rectangles_are_reciprocal_additive_and_without_scale() {
    let mut chance = Chance(3);
    for _ in 0..200 {
        let [x, y, xi, eta] = [0; 4].map(|_| chance.side(2.0));
        let z = chance.size(2.0);
        let area = |a: [f64; 2], b: [f64; 2]| (a[1] - a[0]) * (b[1] - b[0]);
        let there = aligned_rectangles(x, y, xi, eta, z).unwrap().ratio();
        let back = aligned_rectangles(xi, eta, x, y, z).unwrap().ratio();
        let said = format!("{x:?} {y:?} {xi:?} {eta:?} {z}: {there:e} {back:e}");
        assert!((0.0..=1.0).contains(&there), "{said}");
        assert!(close(area(x, y) * there, area(xi, eta) * back, 1e-12), "{said}");
        let middle = xi[0].midpoint(xi[1]);
        let halves = [[xi[0], middle], [middle, xi[1]]]
            .map(|half| aligned_rectangles(x, y, half, eta, z).unwrap().ratio());
        assert!(close(there, halves[0] + halves[1], 1e-12), "{said} {halves:?}");
        let times = |side: [f64; 2]| side.map(|end| end * 2_f64.powi(-40));
        let small =
            aligned_rectangles(times(x), times(y), times(xi), times(eta), z * 2_f64.powi(-40));
        assert_eq!(small.unwrap().ratio().to_bits(), there.to_bits(), "{said}");
    }
}

#[test]
fn the_faces_of_random_boxes_close() {
    let mut chance = Chance(5);
    for _ in 0..300 {
        let [a, b, c] = [0; 3].map(|_| chance.size(4.0));
        let lid = form_factor::parallel_rectangles(a, b, c).unwrap().ratio();
        let wall_b = form_factor::perpendicular_rectangles(a, c, b).unwrap().ratio();
        let wall_a = form_factor::perpendicular_rectangles(b, c, a).unwrap().ratio();
        let closure = lid + 2.0 * (wall_a + wall_b);
        assert!((closure - 1.0).abs() < 2e-13, "{a} {b} {c}: {closure}");
    }
}

#[test]
fn random_round_pairs_are_reciprocal() {
    let mut chance = Chance(7);
    for _ in 0..200 {
        let [r1, r2, h] = [0; 3].map(|_| chance.size(3.0));
        let offset = chance.size(3.0);
        let there = form_factor::parallel_disks(r1, r2, h, offset, Tolerance::FINE).unwrap();
        let back = form_factor::parallel_disks(r2, r1, h, offset, Tolerance::FINE).unwrap();
        let said = format!("{r1} {r2} {h} {offset} {there:?} {back:?}");
        assert!(close(r1 * r1 * there.value, r2 * r2 * back.value, 1e-12), "{said}");
        let d = (r1 + r2) * (1.0 + h * h);
        let there = form_factor::spheres(r1, r2, d, Tolerance::FINE).unwrap();
        let back = form_factor::spheres(r2, r1, d, Tolerance::FINE).unwrap();
        let said = format!("{r1} {r2} {d} {there:?} {back:?}");
        assert!(close(r1 * r1 * there.value, r2 * r2 * back.value, 1e-12), "{said}");
        // Far or small, the sphere's solid angle.
        let cap = 0.5 * (r2 / d) * (r2 / d);
        assert!(r1 > 1e-3 * d || r2 > 1e-3 * d || close(there.value, cap / 2.0, 1e-5), "{said}");
    }
}

#[test]
fn random_polygons_are_reciprocal_and_their_bounds_hold_against_closed_forms() {
    let mut chance = Chance(11);
    let tolerance = Tolerance::from_relative(1e-7).unwrap();
    let at = |x: [f64; 2], y: [f64; 2], z: f64| {
        let corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])];
        Polygon::new(corners.map(|(x, y)| DVec3::new(x, y, z)).to_vec()).unwrap()
    };
    for _ in 0..40 {
        let [x, y, xi, eta] = [0; 4].map(|_| chance.side(1.0));
        let z = chance.size(2.0);
        let exact = aligned_rectangles(x, y, xi, eta, z).unwrap().ratio();
        let said = format!("{x:?} {y:?} {xi:?} {eta:?} {z}: {exact:e}");
        let there = form_factor::polygons(&at(x, y, 0.0), &at(xi, eta, z), tolerance)
            .unwrap_or_else(|error| panic!("{said}: {error}"));
        assert!(
            (there.value - exact).abs() <= there.error_bound + 1e-12 * exact,
            "{said} {there:?}"
        );
        assert!(there.meets(tolerance));
    }
}

#[test]
fn strips_that_lie_across_a_line_count_by_the_part_in_front_of_it() {
    const STEPS: u32 = 1500;
    let mut chance = Chance(29);
    let mut counts = [0; 3];
    for _ in 0..400 {
        let mut point = || DVec2::new(2.0 * chance.next(), chance.next());
        let (p, q) = ([point(), point()], [point(), point()]);
        let there = form_factor::strips(p, q);
        let back = form_factor::strips(q, p);
        let left = |of: [DVec2; 2], x: DVec2| (of[1] - of[0]).perp_dot(x - of[0]);
        let sides = |of: [DVec2; 2], x: [DVec2; 2]| x.map(|x| left(of, x) > 0.0);
        let straddles = |of, x| sides(of, x)[0] != sides(of, x)[1];
        match (straddles(p, q), straddles(q, p)) {
            (true, true) => {
                counts[0] += 1;
                assert!(there.is_err() && back.is_err());
                continue;
            }
            (false, false) => counts[1] += 1,
            _ => counts[2] += 1,
        }
        let (there, back) = (there.unwrap().ratio(), back.unwrap().ratio());
        let (a, b) = (p[0].distance(p[1]), q[0].distance(q[1]));
        assert!(close(a * there, b * back, 1e-14), "{p:?} {q:?}");
        // By sight: from each point of p, the sines between the ends of what is before it.
        let (normal_p, normal_q) = ((p[1] - p[0]).perp() / a, (q[1] - q[0]).perp() / b);
        let face = |of: [DVec2; 2], others: [DVec2; 2]| match sides(of, others) {
            [false, false] => -1.0,
            _ => 1.0,
        };
        let (face_p, face_q) = (face(p, q), face(q, p));
        let mut sum = 0.0;
        for i in 0..STEPS {
            let x = p[0].lerp(p[1], (f64::from(i) + 0.5) / f64::from(STEPS));
            if face_q * left(q, x) <= 0.0 {
                continue;
            }
            for j in 0..60 {
                let y = q[0].lerp(q[1], (f64::from(j) + 0.5) / 60.0);
                let ray = y - x;
                let cosines = [face_p * normal_p.dot(ray), -face_q * normal_q.dot(ray)];
                if cosines[0] > 0.0 && cosines[1] > 0.0 {
                    sum += cosines[0] * cosines[1] / (2.0 * ray.length().powi(3)) * b / 60.0;
                }
            }
        }
        let nearest = [p[0], p[1], q[0], q[1]].map(|x| {
            let segments = [p, q].map(|s| {
                let along = s[1] - s[0];
                let t = ((x - s[0]).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                x.distance(s[0] + along * t)
            });
            segments[0].max(segments[1])
        });
        let gap = nearest.into_iter().fold(f64::MAX, f64::min);
        let mean = sum / f64::from(STEPS);
        assert!(gap < 0.1 || (mean - there).abs() < 0.02, "{p:?} {q:?}: {there} {mean}");
    }
    assert!(counts.iter().all(|count| *count > 20), "{counts:?}");
}

#[test]
fn nothing_given_makes_a_nan_or_a_panic() {
    let odd = [0.0, -0.0, 1.0, -1.0, 1e-320, 1e-200, 1e200, f64::MAX, f64::INFINITY, f64::NAN, 2.5];
    let mut chance = Chance(13);
    let mut pick = || odd[chance.index(odd.len())];
    let coarse = Tolerance::new(1e-3, 0.0, 10_000).unwrap();
    let check = |factor: Result<f64, EstimateError>| {
        if let Ok(ratio) = factor {
            assert!((0.0..=1.0).contains(&ratio), "{ratio}");
        }
    };
    for _ in 0..2000 {
        let [a, b, c, d] = [0; 4].map(|_| pick());
        let [p, q, r, s] = [0; 4].map(|_| [pick(), pick()]);
        let value = |estimate: Estimate| estimate.value;
        let ratio = |factor: radiometry::quantity::FormFactor| factor.ratio();
        check(aligned_rectangles(p, q, r, s, a).map(ratio));
        check(form_factor::perpendicular_offset_rectangles(p, q, r, s).map(ratio));
        check(form_factor::wedge_rectangles(a, b, c, d, coarse).map(value));
        check(form_factor::parallel_disks(a, b, c, d, coarse).map(value));
        check(form_factor::spheres(a, b, c, coarse).map(value));
        check(form_factor::sphere_disk(a, b, c).map(ratio).map_err(EstimateError::from));
        check(form_factor::concentric_spheres(a, b).map(ratio).map_err(EstimateError::from));
        check(form_factor::parallel_cylinders(a, b).map(ratio).map_err(EstimateError::from));
        let strip = |a: [f64; 2], b: [f64; 2]| [DVec2::from_array(a), DVec2::from_array(b)];
        let strips = form_factor::strips(strip(p, q), strip(r, s)).map(ratio);
        check(strips.map_err(EstimateError::from));
        let triangle = |z: f64| Polygon::new([p, q, r].map(|v| DVec3::new(v[0], v[1], z)).to_vec());
        if let (Ok(from), Ok(to)) = (triangle(a), triangle(b)) {
            check(form_factor::polygons(&from, &to, coarse).map(value));
        }
    }
}

#[test]
fn polygons_agree_with_quasi_monte_carlo() {
    let corners = |list: [[f64; 3]; 3]| list.map(DVec3::from_array);
    let mut chance = Chance(17);
    for seed in 0..8 {
        let mut vertex = |z: f64| [chance.next(), chance.next(), z + 0.5 * chance.next()];
        let from = corners([vertex(0.0), vertex(0.0), vertex(0.0)]);
        let to = corners([vertex(2.0), vertex(2.0), vertex(2.0)]);
        let place = |t: [DVec3; 3], u: f64, v: f64| {
            let root = u.sqrt();
            t[0] + root * ((t[1] - t[0]) + v * (t[2] - t[1]))
        };
        let normals = [from, to].map(|t| (t[1] - t[0]).cross(t[2] - t[0]));
        let turned = |normal: DVec3, towards: DVec3| normal * normal.dot(towards).signum();
        let facing = [turned(normals[0], to[0] - from[0]), turned(normals[1], from[0] - to[0])];
        let scale = facing[1].length() / 2.0 / std::f64::consts::PI;
        let ray = |p: &[f64; 4]| {
            let (start, end) = (place(from, p[0], p[1]), place(to, p[2], p[3]));
            let ray = end - start;
            let cosines = [facing[0].dot(ray), -facing[1].dot(ray)].map(|cosine| cosine.max(0.0));
            let lengths = facing[0].length() * facing[1].length();
            scale * cosines[0] * cosines[1] / lengths / ray.length_squared().powi(2)
        };
        let one_side = |point: DVec3, normal: DVec3, all: [DVec3; 3]| {
            all.iter().all(|vertex| normal.dot(*vertex - point) > 0.0)
        };
        // Where a plane cuts the other triangle, the two count different rays.
        if !one_side(from[0], facing[0], to) || !one_side(to[0], facing[1], from) {
            continue;
        }
        let tolerance = Tolerance::from_relative(1e-4).unwrap();
        let sampled = quasi_monte_carlo(ray, seed, tolerance).unwrap();
        let polygon = |t: [DVec3; 3]| Polygon::new(t.to_vec()).unwrap();
        let fine = Tolerance::from_relative(1e-9).unwrap();
        let exact = form_factor::polygons(&polygon(from), &polygon(to), fine).unwrap();
        assert!(
            (sampled.value - exact.value).abs() <= sampled.error_bound,
            "{sampled:?} {exact:?}"
        );
    }
}

#[test]
fn triangles_that_share_an_edge_are_reciprocal_and_turn_with_the_frame() {
    let mut chance = Chance(19);
    let tolerance = Tolerance::from_relative(1e-8).unwrap();
    for _ in 0..20 {
        let (along, across) = (chance.size(1.0), chance.size(2.0));
        let angle = 0.05 + 3.0 * chance.next();
        let apex = DVec3::new(chance.next(), angle.cos() * across, angle.sin() * across);
        let first = [DVec3::ZERO, DVec3::X * along, DVec3::new(chance.next(), 1.0, 0.0)];
        let second = [DVec3::ZERO, DVec3::X * along, apex];
        let polygon = |t: [DVec3; 3]| Polygon::new(t.to_vec()).unwrap();
        let factor = |a: [DVec3; 3], b: [DVec3; 3]| {
            form_factor::polygons(&polygon(a), &polygon(b), tolerance)
                .unwrap_or_else(|error| panic!("{a:?} {b:?}: {error}"))
        };
        let (there, back) = (factor(first, second), factor(second, first));
        assert!(close(there.value, across * back.value, 2e-8), "{there:?} {back:?}");
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.2, -2.0);
        let moved = |t: [DVec3; 3]| t.map(|vertex| turn * vertex + DVec3::new(3.0, -1.0, 2.0));
        let turned = factor(moved(first), moved(second));
        assert!(close(there.value, turned.value, 2e-8), "{there:?} {turned:?}");
    }
}
