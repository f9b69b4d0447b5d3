//! The results of the paper's experiments as text.

use crate::paper::SOURCE;
use crate::{Experiments, HiddenRow, MeshRow, Pair, Perimeter, RunRow, SignedRankRow};

/// Formats the results of all experiments.
pub fn words(report: &Experiments) -> String {
    let mut text = format!(
        "Experiments of {SOURCE}, repeated at {} m/s in the blueprint's tunnel. Each pair is the paper's figure and ours.\n",
        report.speed_mps
    );
    runs(&mut text, "Table 3. One head", report.runs.iter().filter(|row| row.heads == 1));
    let several = |sectors| report.runs.iter().filter(move |row| row.heads > 1 && row.sectors == sectors);
    runs(&mut text, "Table 4. Several heads, phase shift", several(false));
    runs(&mut text, "Table 4. Several heads, sector offset", several(true));
    combined(&mut text, &report.runs);
    misses(&mut text, &report.runs);
    signed_ranks(&mut text, &report.signed_ranks);
    meshes(&mut text, &report.meshes);
    hidden(&mut text, &report.hidden);
    perimeter(&mut text, &report.perimeter);
    text.push_str("\nWhat the paper found\n");
    for finding in &report.findings {
        let holds = if finding.holds { "holds       " } else { "DOESN'T HOLD" };
        line(&mut text, format_args!("  {holds}  {}\n                {}", finding.says, finding.evidence));
    }
    text
}

fn line(text: &mut String, words: std::fmt::Arguments<'_>) {
    text.push_str(&words.to_string());
    text.push('\n');
}

fn name(row: &RunRow) -> String {
    format!("  {:<8}{}", row.mode, row.heads)
}

fn pair(pair: &Pair) -> String {
    format!("{:>8.3}{:>8.4}", pair.paper, pair.ours)
}

fn percent(pair: &Pair) -> String {
    format!("{:>+6.1} %", 100.0 * pair.difference())
}

fn runs<'a>(text: &mut String, title: &str, rows: impl Iterator<Item = &'a RunRow>) {
    line(text, format_args!("\n{title}, m"));
    line(
        text,
        format_args!(
            "  mode    s      T_x    ours     by   mean T_y    ours     by        sd    ours     min    ours     max    ours"
        ),
    );
    for row in rows {
        let [mean, sd, min, max] = &row.t_y;
        line(
            text,
            format_args!(
                "{}{}{}   {}{}  {}{}{}",
                name(row),
                pair(&row.t_x),
                percent(&row.t_x),
                pair(mean),
                percent(mean),
                pair(sd),
                pair(min),
                pair(max)
            ),
        );
    }
}

fn combined(text: &mut String, rows: &[RunRow]) {
    line(text, format_args!("\nTable 5. T, m"));
    line(text, format_args!("  mode    s          mean    ours     by      min    ours     max    ours"));
    for row in rows {
        let Some([mean, min, max]) = &row.t else { continue };
        let layout = if row.sectors { "sector" } else { "phase " };
        line(
            text,
            format_args!("{} {layout}{}{} {}{}", name(row), pair(mean), percent(mean), pair(min), pair(max)),
        );
    }
}

fn misses(text: &mut String, rows: &[RunRow]) {
    line(text, format_args!("\nBeyond 2 % in T_x or 3 % in the means"));
    for row in rows {
        for miss in &row.misses {
            let layout = if row.sectors { "sector offset" } else { "phase shift" };
            line(text, format_args!("{} {layout}: {miss}", name(row)));
        }
    }
    if rows.iter().all(|row| row.misses.is_empty()) {
        line(text, format_args!("  none"));
    }
}

fn signed_ranks(text: &mut String, rows: &[SignedRankRow]) {
    line(
        text,
        format_args!(
            "\nWilcoxon signed-rank tests of predicted against measured, 15 runs each; p, two-sided"
        ),
    );
    line(text, format_args!("                          paper's runs   ours"));
    for row in rows {
        let layout = if row.sectors { "sector offset" } else { "phase shift" };
        let p = |p: Option<f64>| p.map_or_else(|| "-".to_owned(), |p| format!("{p:.4}"));
        line(text, format_args!("  {:<10}{layout:<14}{:>10}{:>10}", row.what, p(row.p_paper), p(row.p_ours)));
    }
}

fn meshes(text: &mut String, rows: &[MeshRow]) {
    line(text, format_args!("\nDistance of the wall from a surface through the samples, mean (sd), mm"));
    line(
        text,
        format_args!(
            "                                          paper    Poisson, depth 8   plain interpolation"
        ),
    );
    for row in rows {
        let mm = |[mean, sd]: [f64; 2]| format!("{:.1} ({:.1})", 1e3 * mean, 1e3 * sd);
        let layout = if row.sectors { "sector offset" } else { "phase shift" };
        let aligned = if row.aligned { "aligned" } else { "unaligned" };
        let paper = row.paper_m.map_or_else(|| "-".to_owned(), mm);
        line(
            text,
            format_args!(
                "  {} heads {:<7}{layout:<14}{aligned:<10}{paper:>14}{:>18}{:>18}",
                row.heads,
                row.mode,
                mm(row.poisson_m),
                mm(row.plain_m)
            ),
        );
    }
}

fn hidden(text: &mut String, rows: &[HiddenRow]) {
    line(text, format_args!("\nWhat heads side by side hide (paper: about 15.07 deg and 1.7 m)"));
    for row in rows {
        line(
            text,
            format_args!(
                "  {} heads, neighbours {:>3.0} deg apart: {:.2} deg and {:.2} m hidden; T_x / s {:.3} m, {:.2} times that in the \
                 shadow, {:.2} at most",
                row.heads,
                row.side_by_side_deg,
                row.angle_deg,
                row.gap_m,
                row.t_x_m,
                row.times_in_shadow,
                row.times
            ),
        );
    }
}

fn perimeter(text: &mut String, perimeter: &Perimeter) {
    line(text, format_args!("\nPerimeter from a stationary turn, beam of 1.4 deg, m"));
    for (what, value) in [
        ("blueprint", perimeter.nominal_m),
        ("paper", perimeter.paper_m),
        ("skeleton of the echoes, steps of 1 and sqrt 2", perimeter.skeleton_m),
        ("skeleton of the echoes, corrected", perimeter.skeleton_smooth_m),
        ("polygon through first returns", perimeter.first_returns_m),
        ("polygon through mean ranges", perimeter.mean_ranges_m),
        ("polygon through ideal rays", perimeter.rays_m),
    ] {
        let off = 100.0 * (value / perimeter.nominal_m - 1.0);
        line(text, format_args!("  {what:<48}{value:>7.2}  {off:+.2} %"));
    }
}
