//! What `gonio fit` is asked to pin on the command line, and where that is silent by the plan. Knows no
//! reading.

use fit::{AngularKind, Fine, Robust, Rules, Spans, Symmetry, Wish, WishClash};

use super::args::FitArgs;
use super::failure::Failure;

/// What the command line decides, and where it is silent the plan. A basis named here leaves the
/// plan's degree and penalty, which were meant for another, aside.
pub(super) fn wished(args: &FitArgs, plan: Wish) -> Result<Wish, Failure> {
    let spans = spans(args)?;
    let named = args.basis.as_deref().map(kind_named).transpose()?;
    let kind = named.or(spans.map(|_| AngularKind::Splines));
    let Wish { position_degree, position_spans, .. } = plan;
    let base = if kind.is_some() && kind != plan.kind {
        Wish { position_degree, position_spans, ..Wish::default() }
    } else {
        plan
    };
    for (flag, value) in
        [("--penalty-power", args.penalty_power), ("--penalty-strength", args.penalty_strength)]
    {
        if value.is_some_and(|value| !(value >= 0.0 && value.is_finite())) {
            return Err(Failure::start(format!("{flag}: expected a number of 0 or more")));
        }
    }
    // What is said here takes the place of what the plan says otherwise.
    let unless = |said: bool, planned: Option<usize>| planned.filter(|_| !said);
    let wish = Wish {
        kind: kind.or(base.kind),
        angular_degree: args.angular_degree.or(unless(spans.is_some(), base.angular_degree)),
        cosine_columns: args.cosine_columns.or(unless(spans.is_some(), base.cosine_columns)),
        spans: spans.or(base.spans.filter(|_| args.angular_degree.is_none())),
        position_degree: args
            .position_degree
            .or(unless(args.position_spans.is_some(), base.position_degree)),
        position_spans: args
            .position_spans
            .or(unless(args.position_degree.is_some(), base.position_spans)),
        penalty_power: args.penalty_power.or(base.penalty_power),
        penalty_strength: args.penalty_strength.or(base.penalty_strength),
        rules: rules(args, plan.rules)?,
    };
    if let Some(clash) = wish.clash() {
        let flag = match clash {
            WishClash::DegreeOfSplines => "--angular-degree",
            WishClash::SpansOfOthers | WishClash::OpenStrength => "--theta-spans",
            WishClash::CosineColumns => "--cosine-columns",
            WishClash::DegreeAndSpans => "--position-spans",
        };
        return Err(Failure::with_help(
            format!("{flag}: {clash}; expected {}", clash.expected()),
            clash.help(),
        ));
    }
    Ok(wish)
}

/// The spans of splines in direction that the command line pins.
fn spans(args: &FitArgs) -> Result<Option<Spans>, Failure> {
    let (Some(theta), Some(phi)) = (args.theta_spans, args.phi_spans) else { return Ok(None) };
    let around = args.fine_phi_spans.as_deref();
    let fine = match &args.fine_spans {
        None => Fine::NONE,
        Some(numbers) => Fine::of(numbers, around, (theta, phi)).ok_or_else(|| match around {
            None => Failure::with_help(
                format!("--fine-spans: no stretch of {theta} spans of theta"),
                "expected FIRST,AFTER_LAST,HALVINGS: whole numbers, FIRST < AFTER_LAST <= spans of theta, \
                 1 to 8 halvings, as fine_spans of the choice in fit.json",
            ),
            Some(_) => Failure::with_help(
                format!("--fine-phi-spans: no stretch of {theta} spans of theta and {phi} of phi"),
                "expected FIRST,AFTER_LAST,HALVINGS of both: whole numbers, of phi FIRST < spans of phi \
                 and no more than a full turn, 1 to 8 halvings, of theta as --fine-spans alone, 0 to 8 \
                 halvings",
            ),
        })?,
    };
    Ok(Some(Spans { theta, phi, fine }))
}

/// What holds beyond the basis, by the command line, and where it is silent the plan.
fn rules(args: &FitArgs, plan: Rules) -> Result<Rules, Failure> {
    let unknown = |flag: &str, name: &str, known: String| {
        Failure::with_help(format!("{flag}: `{name}` is not known"), format!("expected {known}"))
    };
    let robust = match &args.robust {
        None => plan.robust,
        Some(name) => Robust::ALL
            .into_iter()
            .find(|robust| robust.name() == name)
            .ok_or_else(|| unknown("--robust", name, Robust::ALL.map(Robust::name).join(", ")))?,
    };
    let phi_deg = args.symmetry_phi_deg.unwrap_or(0.0);
    if !phi_deg.is_finite() {
        return Err(Failure::start("--symmetry-phi-deg: expected a finite angle"));
    }
    let known = Symmetry::all_at(phi_deg.to_radians());
    let symmetry = match &args.symmetry {
        None => plan.symmetry,
        Some(name) => Some(
            known
                .into_iter()
                .find(|symmetry| symmetry.key() == name)
                .ok_or_else(|| unknown("--symmetry", name, known.map(Symmetry::key).join(", ")))?,
        ),
    };
    if args.symmetry_phi_deg.is_some() && !symmetry.is_some_and(Symmetry::has_azimuth) {
        return Err(Failure::with_help(
            "--symmetry-phi-deg: rotational symmetry has no mirror",
            "leave it out, or ask for --symmetry plane or quadrant",
        ));
    }
    Ok(Rules {
        robust,
        nonnegative: args.nonnegative || plan.nonnegative,
        symmetry,
        drift: args.drift.or(plan.drift),
        ranges: plan.ranges,
    })
}

fn kind_named(name: &str) -> Result<AngularKind, Failure> {
    AngularKind::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
        let known = AngularKind::ALL.map(AngularKind::name).join(", ");
        Failure::with_help(
            format!("--basis: `{name}` is not a basis"),
            format!("expected one of {known}, or none: it is then chosen from the readings"),
        )
    })
}
