//! The experimental columns of Tables 3 to 5, as printed by Jorge et al. 2021.

use super::PaperError;
use super::printed::{Line, Printed, lines};

/// The paper's measurements of a simulated run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The mode's name, in capitals.
    pub mode: &'static str,
    /// Number of heads.
    pub heads: u8,
    /// Sample spacings of heads in phase shift, or of a single head that turns continuously.
    pub phase_shift: Spacings,
    /// Sample spacings of heads in sector offset; `None` for a run with a single head.
    pub sector_offset: Option<Spacings>,
}

/// Sample spacings that the paper prints for a run, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacings {
    /// Distance T_x between passes.
    pub t_x_m: Printed,
    /// Distance T_y between pings: mean, standard deviation, least, largest.
    pub t_y_m: [Printed; 4],
    /// Combined distance T: mean, least, largest; from Table 5, which has no rows for one head.
    pub t_m: Option<[Printed; 3]>,
}

/// The runs of Table 3, then those of Tables 4 and 5.
///
/// Errors: none with the built-in numbers.
pub fn measured() -> Result<Vec<Measured>, PaperError> {
    let mut runs = Vec::new();
    for line in lines(3) {
        let [t_x, mean, sd, min, max] = ["exp_tx", "exp_ty_mean", "exp_ty_std", "exp_ty_min", "exp_ty_max"];
        let phase_shift = spacings(&line, [t_x, mean, sd, min, max], None)?;
        runs.push(Measured { mode: line.text("mode")?, heads: 1, phase_shift, sector_offset: None });
    }
    for (line, combined) in lines(4).iter().zip(lines(5)) {
        let phase = ["phase_tx", "phase_ty_mean", "phase_ty_std", "phase_ty_min", "phase_ty_max"];
        let sector = ["sector_tx", "sector_ty_mean", "sector_ty_std", "sector_ty_min", "sector_ty_max"];
        let phase_t = ["phase_t_mean", "phase_t_min", "phase_t_max"];
        let sector_t = ["sector_t_mean", "sector_t_min", "sector_t_max"];
        runs.push(Measured {
            mode: line.text("mode")?,
            heads: line.heads()?,
            phase_shift: spacings(line, phase, Some((&combined, phase_t)))?,
            sector_offset: Some(spacings(line, sector, Some((&combined, sector_t)))?),
        });
    }
    Ok(runs)
}

fn spacings(
    line: &Line,
    [t_x, mean, sd, min, max]: [&'static str; 5],
    combined: Option<(&Line, [&'static str; 3])>,
) -> Result<Spacings, PaperError> {
    let t_m = match combined {
        None => None,
        Some((line, [mean, min, max])) => Some([line.printed(mean)?, line.printed(min)?, line.printed(max)?]),
    };
    Ok(Spacings {
        t_x_m: line.printed(t_x)?,
        t_y_m: [line.printed(mean)?, line.printed(sd)?, line.printed(min)?, line.printed(max)?],
        t_m,
    })
}
