//! `[fit]` in plan.toml: what of the fit a plan pins. What a basis is good for is not known here.

use std::ops::RangeInclusive;

use fit::{AngularKind, Fine, Robust, Rules, Spans, Symmetry, Wish, WishClash};
use spanned_toml::{Bounds, Problem, Table};

use super::file::PHI_DEG;

/// `[fit]`: what of the fit's basis is decided beforehand; what it doesn't name, and all of it where
/// there is no such table, is chosen from the readings by leaving out whole sweeps.
///
/// `basis`: "zernike", "hemispherical", "even-harmonics", "spherical" or "splines". `angular_degree`: of
/// the polynomials in direction, Zernike's unless `basis` says otherwise; `cosine_columns` beside those:
/// how many further functions cos θ Z(2k,0). Of splines instead `theta_spans` from the normal to the
/// horizon and `phi_spans` round it, and `fine_spans = [first, after_last, halvings]` where those of θ
/// are halved, `fine_phi_spans` where within those of φ are. `position_degree`: total degree of the polynomials in x and y, or `position_spans` of
/// splines along each side. `penalty_power` and `penalty_strength`: how roughness is held against the
/// field, see docs/fit.md; 0 for not at all, which is also what a pinned `angular_degree` means without
/// them. All of these as `choice` in fit.json names them.
pub(super) fn read_fit(table: Table<'_>) -> Result<Wish, Problem> {
    let count = |key: &str, range: RangeInclusive<i64>| {
        let count = table.integer(key, range)?;
        Ok(count.map(|count| usize::try_from(count).unwrap_or_default()))
    };
    let spans = read_spans(&table, &count)?;
    let named = table.choice("basis", &AngularKind::OF_SURFACE.map(|kind| (kind.name(), kind)))?;
    let fit = Wish {
        kind: named.or(spans.map(|_| AngularKind::Splines)),
        angular_degree: count("angular_degree", 0..=ANGULAR_DEGREE_MAX)?,
        cosine_columns: count("cosine_columns", 0..=COSINE_COLUMNS_MAX)?,
        spans,
        position_degree: count("position_degree", 0..=POSITION_DEGREE_MAX)?,
        position_spans: count("position_spans", 1..=POSITION_SPANS_MAX)?,
        penalty_power: table.number("penalty_power", PENALTY_POWER)?,
        penalty_strength: table.number("penalty_strength", PENALTY_STRENGTH)?,
        rules: read_rules(&table)?,
    };
    if let Some(clash) = fit.clash() {
        let key = match clash {
            WishClash::DegreeOfSplines => "angular_degree",
            WishClash::SpansOfOthers | WishClash::OpenStrength => "theta_spans",
            WishClash::CosineColumns => "cosine_columns",
            WishClash::DegreeAndSpans => "position_spans",
        };
        return Err(table.problem(key, &clash.to_string(), clash.expected(), clash.help()));
    }
    table.finish()?;
    Ok(fit)
}

/// The spans of splines in direction.
fn read_spans(
    table: &Table<'_>,
    count: &impl Fn(&str, RangeInclusive<i64>) -> Result<Option<usize>, Problem>,
) -> Result<Option<Spans>, Problem> {
    let theta = count("theta_spans", 1..=SPANS_MAX)?;
    let phi = count("phi_spans", 1..=SPANS_MAX)?;
    let fine = table.numbers("fine_spans", Bounds::between(0.0, SPANS_MAX as f64), 3..=3)?;
    let around = table.numbers("fine_phi_spans", Bounds::between(0.0, SPANS_MAX as f64), 3..=3)?;
    let (Some(theta), Some(phi)) = (theta, phi) else {
        let (key, other) = match (theta, phi, &fine, &around) {
            (Some(_), ..) => ("theta_spans", "phi_spans"),
            (_, Some(_), ..) => ("phi_spans", "theta_spans"),
            (_, _, Some(_), _) => ("fine_spans", "theta_spans and phi_spans"),
            (.., Some(_)) => ("fine_phi_spans", "theta_spans, phi_spans and fine_spans"),
            _ => return Ok(None),
        };
        let what = format!("{key} without {other}");
        return Err(table.problem(key, &what, other, "add it, or leave both to be chosen"));
    };
    let Some(numbers) = fine else {
        if around.is_none() {
            return Ok(Some(Spans { theta, phi, fine: Fine::NONE }));
        }
        let what = "fine_phi_spans without fine_spans";
        let help = "say in which stretch of theta, or leave both out";
        return Err(table.problem("fine_phi_spans", what, "fine_spans", help));
    };
    if Fine::of(&numbers, None, (theta, phi)).is_none() && around.is_none() {
        return Err(table.problem(
            "fine_spans",
            "no stretch of the spans of theta",
            "[first, after_last, halvings]: whole numbers, first < after_last <= theta_spans, 1 to 8 \
             halvings",
            "copy fine_spans from the choice in fit.json, or leave it out",
        ));
    }
    let fine = Fine::of(&numbers, around.as_deref(), (theta, phi)).ok_or_else(|| {
        table.problem(
            "fine_phi_spans",
            "no stretch of the spans of phi within one of theta",
            "[first, after_last, halvings] of both: whole numbers, of phi first < phi_spans and no more \
             than a full turn, 1 to 8 halvings, of theta as fine_spans alone, 0 to 8 halvings",
            "copy fine_spans and fine_phi_spans from the choice in fit.json, or leave them out",
        )
    })?;
    Ok(Some(Spans { theta, phi, fine }))
}

/// What holds for the fit beyond its basis.
///
/// `robust`: "huber" or "tukey", how readings that don't belong are reweighed; "none" unless asked for,
/// since a lobe narrower than the basis follows looks like such readings. `nonnegative`: whether the
/// field is held above zero. `symmetry`: "rotational", "quadrant" or "plane" about the region's middle,
/// used if the readings bear it; `symmetry_phi_deg`: the azimuth of the mirror, 0 unless said.
/// `drift`: whether a drift by the reference readings is fitted along; where they show one unless said.
/// `ranges`: whether the gain ranges' dark levels and gains are; where more than one is used unless said.
fn read_rules(table: &Table<'_>) -> Result<Rules, Problem> {
    let robust = table.choice("robust", &Robust::ALL.map(|robust| (robust.name(), robust)))?;
    let phi_rad = table.number("symmetry_phi_deg", PHI_DEG)?.map(f64::to_radians);
    let at = phi_rad.unwrap_or(0.0);
    let symmetry = table.choice("symmetry", &Symmetry::all_at(at).map(|s| (s.key(), s)))?;
    if phi_rad.is_some() && !symmetry.is_some_and(Symmetry::has_azimuth) {
        return Err(table.problem(
            "symmetry_phi_deg",
            "there is no mirror to stand at an azimuth",
            "symmetry = \"plane\" or \"quadrant\" beside it",
            "add one of them, or leave symmetry_phi_deg out",
        ));
    }
    Ok(Rules {
        robust: robust.unwrap_or_default(),
        nonnegative: table.flag("nonnegative")?.unwrap_or(false),
        symmetry,
        drift: table.flag("drift")?,
        ranges: table.flag("ranges")?,
    })
}

const ANGULAR_DEGREE_MAX: i64 = 60;
const COSINE_COLUMNS_MAX: i64 = 8;
/// Of splines: more are narrower than any encoder tells.
const SPANS_MAX: i64 = 4096;
/// The choice tries up to 14.
const POSITION_DEGREE_MAX: i64 = 14;
const POSITION_SPANS_MAX: i64 = 64;
const PENALTY_POWER: Bounds = Bounds::between(0.0, 18.0);
const PENALTY_STRENGTH: Bounds = Bounds::between(0.0, 1e30);
