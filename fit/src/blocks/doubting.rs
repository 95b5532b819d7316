//! What other functions make of directions where nothing was measured: each fitted by walks of its own.

use super::fitting::Fitting;
use super::{Asked, Blocks, Totals};
use crate::Fit;

/// The fit with what the others say in every u. Functions that can't be fitted to so many readings say
/// nothing.
pub(super) fn doubted<B: Blocks>(
    fit: Fit,
    blocks: &mut B,
    totals: &Totals,
    asked: &Asked<'_>,
) -> Result<Fit, B::Error> {
    if !fit.is_doubted_by(asked.others) {
        return Ok(fit);
    }
    let mut fields = Vec::with_capacity(asked.others.len());
    for model in asked.others {
        if let Ok(fitting) = Fitting::new(totals, Asked { model: *model, ..*asked }) {
            fields.push(fitting.field(blocks)?);
        }
    }
    Ok(fit.doubted_by(fields))
}
