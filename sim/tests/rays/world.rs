//! The scene as the reference sees it: bodies, what each does to light, and paths traced from the
//! detector backwards, one lamp place drawn at each place that is lit. It shares with the simulator
//! the scene's numbers and nothing else.

use core::f64::consts::{PI, TAU};

use glam::DVec3;
use sim::{Body, Emitter, Image, Lamp, LampSource, Law, Reflection, Scene, Shape, WindowOwner};

use crate::dice::Dice;
use crate::form::Form;
use crate::glass::Glass;

/// Radiance from a place into a direction of a unit normal's hemisphere.
type Glow = Box<dyn Fn(DVec3, DVec3, DVec3) -> f64>;

enum Matter {
    Black,
    /// Its front.
    Emits(Glow),
    /// Both faces.
    Shines(f64),
    /// Its front.
    Reflects(Reflection),
}

struct Thing {
    form: Form,
    matter: Matter,
}

/// Where a ray through windows ended.
struct Walk<'w> {
    end: Option<(DVec3, &'w Thing)>,
    direction: DVec3,
    /// What of the light is left.
    part: f64,
    /// Whether a window threw it back.
    is_mirrored: bool,
}

/// What is seen, by brute force.
pub(crate) struct World {
    things: Vec<Thing>,
    /// Direction, half angle, radiance.
    suns: Vec<(DVec3, f64, f64)>,
    sky: Option<(Image, f64)>,
    glasses: Vec<(Glass, WindowOwner)>,
}

impl World {
    /// `laws`: of the emitters, in their order, where [`glow`] asks for them.
    pub(crate) fn new(scene: &Scene, laws: &[fn(DVec3) -> f64]) -> Self {
        let mut world =
            Self { things: Vec::new(), suns: Vec::new(), sky: None, glasses: Vec::new() };
        let form = |body: &Body| match body {
            Body::Flat(shape) => Form::of_shape(shape),
            Body::Raised(solid) => Form::of(solid),
        };
        for (i, emitter) in scene.emitters().iter().enumerate() {
            let matter = Matter::Emits(glow(emitter, laws.get(i).copied()));
            world.things.push(Thing { form: form(emitter.body()), matter });
        }
        for surface in scene.surfaces() {
            let matter = Matter::Reflects(*surface.reflection());
            world.things.push(Thing { form: form(surface.body()), matter });
        }
        for occluder in scene.occluders() {
            world.things.push(Thing { form: Form::of(occluder), matter: Matter::Black });
        }
        for lamp in scene.lamps() {
            world.add(lamp);
        }
        for window in scene.windows() {
            let glass = Glass {
                low: window.z_m,
                high: window.z_m + window.thickness_m,
                index: window.index,
                absorption: window.absorption_per_m,
            };
            world.glasses.push((glass, window.belongs_to));
        }
        world
    }

    fn add(&mut self, lamp: &Lamp) {
        match lamp.source() {
            LampSource::Body(solid) => {
                let matter = Matter::Shines(lamp.radiance());
                self.things.push(Thing { form: Form::of(solid), matter });
            }
            LampSource::Distant { towards, half_angle_rad } => {
                self.suns.push((*towards, *half_angle_rad, lamp.radiance()));
            }
            LampSource::Surrounding(image) => self.sky = Some((image.clone(), lamp.radiance())),
        }
    }

    /// What arrives at a point against a direction that leads down to the sample.
    pub(crate) fn look(&self, from: DVec3, direction: DVec3, dice: &mut Dice) -> f64 {
        let walk = self.walk(from, direction, &|_| true, dice);
        walk.end
            .map_or(0.0, |(at, thing)| walk.part * self.leaving(thing, at, -walk.direction, dice))
    }

    /// Along a ray, through windows and back from them, to the first thing.
    fn walk(
        &self,
        from: DVec3,
        direction: DVec3,
        is_there: &dyn Fn(WindowOwner) -> bool,
        dice: &mut Dice,
    ) -> Walk<'_> {
        let (mut from, mut direction, mut part) = (from, direction, 1.0);
        let (is_s, began) = (dice.roll() < 0.5, direction.z);
        loop {
            let thing = self.nearest(from, direction);
            let face = self.face(from, direction, is_there);
            let Some((t, glass)) = face.filter(|(t, _)| thing.is_none_or(|(s, _)| *t < s)) else {
                let end = thing.map(|(t, thing)| (from + direction * t, thing));
                return Walk { end, direction, part, is_mirrored: began * direction.z < 0.0 };
            };
            let out = glass.pass(from + direction * t, direction, is_s, dice);
            (from, direction, part) = (out.at, out.direction, part * out.part);
        }
    }

    /// The next face of glass that a ray from outside of all glass meets.
    fn face(
        &self,
        from: DVec3,
        direction: DVec3,
        is_there: &dyn Fn(WindowOwner) -> bool,
    ) -> Option<(f64, Glass)> {
        let glasses = self.glasses.iter().filter(|(_, owner)| is_there(*owner));
        let faces = glasses.filter_map(|(glass, _)| {
            let z = if direction.z < 0.0 { glass.high } else { glass.low };
            let t = (z - from.z) / direction.z;
            (t > 1e-10).then_some((t, *glass))
        });
        faces.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn nearest(&self, from: DVec3, direction: DVec3) -> Option<(f64, &Thing)> {
        let hits = self.things.iter().filter_map(|thing| {
            let t = thing.form.hit(from, direction)?;
            // The sample's plane is black and lets nothing pass from below.
            (from.z + direction.z * t > -1e-9).then_some((t, thing))
        });
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Radiance from a place of a thing into a direction.
    fn leaving(&self, thing: &Thing, at: DVec3, into: DVec3, dice: &mut Dice) -> f64 {
        let normal = thing.form.normal(at);
        match &thing.matter {
            Matter::Black => 0.0,
            Matter::Shines(radiance) => *radiance,
            Matter::Emits(glow) => glow(at, normal, into),
            Matter::Reflects(reflection) => self.reflected(reflection, at, normal, into, dice),
        }
    }

    fn reflected(
        &self,
        reflection: &Reflection,
        at: DVec3,
        normal: DVec3,
        into: DVec3,
        dice: &mut Dice,
    ) -> f64 {
        if normal.dot(into) <= 0.0 {
            return 0.0;
        }
        let f = |from: DVec3| {
            let mirrored = 2.0 * normal.dot(from) * normal - from;
            let cos = mirrored.dot(into).max(0.0);
            let n = reflection.exponent;
            reflection.albedo / PI + reflection.gloss * (n + 2.0) / TAU * cos.powf(n)
        };
        let mut sum = self.direct(at, normal, &f, dice);
        // And by way of another surface, or from the sky: one direction more.
        let survives = (reflection.albedo + reflection.gloss).min(1.0);
        if dice.roll() >= survives {
            return sum;
        }
        let towards = dice.around(normal);
        let weight = PI * f(towards) / survives;
        // The detector's own window is not in the way of light on the sample.
        let walk = self.walk(at, towards, &|owner| owner == WindowOwner::Sample, dice);
        match walk.end {
            Some((there, thing)) => {
                // What emits was aimed at already, but not by way of a window's face.
                let is_new = match &thing.matter {
                    Matter::Reflects(_) => true,
                    Matter::Emits(_) => walk.is_mirrored,
                    Matter::Black | Matter::Shines(_) => false,
                };
                if is_new {
                    let radiance = self.leaving(thing, there, -walk.direction, dice);
                    sum += weight * walk.part * radiance;
                }
            }
            None if walk.direction.z > 0.0 => sum += weight * walk.part * self.sky(walk.direction),
            None => {}
        }
        sum
    }

    /// By one place of each source.
    fn direct(&self, at: DVec3, normal: DVec3, f: &dyn Fn(DVec3) -> f64, dice: &mut Dice) -> f64 {
        let mut sum = 0.0;
        for source in &self.things {
            if matches!(source.matter, Matter::Black | Matter::Reflects(_)) {
                continue;
            }
            if self.has_glass() {
                sum += self.through_glass(source, at, normal, f, dice);
                continue;
            }
            let (place, solid_angle) = source.form.aim(at, dice);
            let towards = (place - at).normalize();
            let there = source.form.normal(place);
            if normal.dot(towards) <= 0.0 || !self.sees(at, place, source) {
                continue;
            }
            let radiance = match &source.matter {
                Matter::Shines(radiance) => *radiance,
                Matter::Emits(glow) => glow(place, there, -towards),
                Matter::Black | Matter::Reflects(_) => 0.0,
            };
            sum += radiance * f(towards) * normal.dot(towards) * solid_angle;
        }
        for (towards, half_angle, radiance) in &self.suns {
            let direction = dice.in_cone(*towards, *half_angle);
            let solid_angle = TAU * 2.0 * (half_angle / 2.0).sin().powi(2);
            let cos = normal.dot(direction);
            if cos > 0.0 && direction.z > 0.0 {
                let walk = self.walk(at, direction, &|owner| owner == WindowOwner::Sample, dice);
                let is_free = walk.end.is_none() && !walk.is_mirrored;
                let passed = if is_free { walk.part } else { 0.0 };
                sum += radiance * f(direction) * cos * solid_angle * passed;
            }
        }
        sum
    }

    fn has_glass(&self) -> bool {
        self.glasses.iter().any(|(_, owner)| *owner == WindowOwner::Sample)
    }

    /// By a direction in which a source may be seen, however glass shifts it.
    fn through_glass(
        &self,
        source: &Thing,
        at: DVec3,
        normal: DVec3,
        f: &dyn Fn(DVec3) -> f64,
        dice: &mut Dice,
    ) -> f64 {
        let (centre, radius) = source.form.ball();
        let thick: f64 = self.glasses.iter().map(|(glass, _)| glass.high - glass.low).sum();
        let part = (radius + thick) / centre.distance(at);
        let half_angle = if part < 1.0 { part.asin() } else { PI };
        let direction = dice.in_cone((centre - at).normalize(), half_angle);
        if normal.dot(direction) <= 0.0 {
            return 0.0;
        }
        let walk = self.walk(at, direction, &|owner| owner == WindowOwner::Sample, dice);
        let Some((there, _)) = walk.end.filter(|(_, thing)| core::ptr::eq(*thing, source)) else {
            return 0.0;
        };
        let radiance = match &source.matter {
            _ if walk.is_mirrored => 0.0,
            Matter::Shines(radiance) => *radiance,
            Matter::Emits(glow) => glow(there, source.form.normal(there), -walk.direction),
            Matter::Black | Matter::Reflects(_) => 0.0,
        };
        let solid_angle = 2.0 * TAU * (half_angle / 2.0).sin().powi(2);
        radiance * walk.part * f(direction) * normal.dot(direction) * solid_angle
    }

    fn sees(&self, at: DVec3, place: DVec3, source: &Thing) -> bool {
        let (towards, length) = ((place - at).normalize(), (place - at).length());
        self.things.iter().all(|thing| {
            core::ptr::eq(thing, source)
                || thing.form.hit(at, towards).is_none_or(|t| t > length * (1.0 - 1e-9))
        })
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
    fn sky(&self, towards: DVec3) -> f64 {
        let Some((image, radiance)) = &self.sky else { return 0.0 };
        let theta = towards.z.clamp(-1.0, 1.0).acos();
        let phi = towards.y.atan2(towards.x);
        let cell = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
        let column = cell((phi + PI) / TAU, image.columns());
        radiance * image.value(column, cell(theta / PI, image.rows()))
    }
}

/// What an emitter's law says, worked out anew from the sentence that documents it. `law`: of what has
/// more numbers than are read back from it, into a direction of the sample's frame.
fn glow(emitter: &Emitter, law: Option<fn(DVec3) -> f64>) -> Glow {
    let level = emitter.level();
    let law: Box<dyn Fn(DVec3, f64) -> f64> = match (emitter.law(), law) {
        (_, Some(law)) => Box::new(move |into, _| law(into)),
        (Law::Lambertian, None) => Box::new(|_, _| 1.0),
        (Law::CosinePower { exponent }, None) => {
            let n = *exponent;
            Box::new(move |_, cos| cos.powf(n))
        }
        (other, None) => panic!("{}: the test says what it is", other.name()),
    };
    let texture = emitter.texture().cloned();
    let rectangle = match emitter.shape() {
        Some(Shape::Rectangle { x_m, y_m }) => Some((*x_m, *y_m)),
        _ => None,
    };
    Box::new(move |at, normal, into| {
        let cos = normal.dot(into);
        if cos <= 0.0 {
            return 0.0;
        }
        let pixel = match (&texture, rectangle) {
            (Some(image), Some((x, y))) => pixel(image, x, y, at),
            _ => 1.0,
        };
        pixel * level * law(into, cos)
    })
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
fn pixel(image: &Image, x: (f64, f64), y: (f64, f64), at: DVec3) -> f64 {
    let cell = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
    let column = cell((at.x - x.0) / (x.1 - x.0), image.columns());
    let row = cell((y.1 - at.y) / (y.1 - y.0), image.rows());
    image.value(column, row)
}
