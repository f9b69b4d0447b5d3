//! `headrace simulate --explain`: lists the simulated effects, the reasons for them, and how the results change if an
//! effect is left out.

use headrace_replay::effect_influence::{
    EffectInfluence, HOLE_LIMIT_M, LeftOut, Mean, PASSED_LIMIT, measure,
};
use headrace_simulator::effects::KINDS as EFFECTS;
use headrace_simulator::{Added, Called, Scene, Simulation, Stage};
use serde_json::{Value, json};

use crate::failure::{self, Failure};
use crate::output::{append, deliver, show};
use crate::phase::Phase;
use crate::progress::Progress;

/// Width of a column that shows a figure with its confidence interval, characters.
const COLUMN: usize = 20;

/// Measures how a scene's results change without each effect. `scenes` is the scene, read with several seeds.
pub(crate) fn worth_of(scenes: &mut [Scene]) -> Result<EffectInfluence, Failure> {
    let _phase = Phase::start("worth");
    let mut progress = Progress::start();
    Ok(measure(scenes, &mut |dived, most| {
        progress.step(&format!("{dived} of at most {most} simulated dives"));
    })?)
}

/// Lists a scene's systems, components and random streams, and the effects that it uses and doesn't use.
///
/// Adds the worth (influence and cost) of each effect if it was measured.
pub(crate) fn explain(scene: &Scene, worth: Option<&EffectInfluence>, as_json: bool) -> Result<u8, Failure> {
    let simulation = Simulation::new(scene)?;
    if as_json {
        deliver(&serde_json::to_string_pretty(&in_json(scene, &simulation, worth))?)?;
        return Ok(failure::OK);
    }
    let mut text = format!(
        "{}: {:.0} s of {}, seed {}\n",
        scene.name,
        simulation.duration_s(),
        scene.vehicle.name,
        scene.seed
    );
    if let Some(worth) = worth {
        text.push_str(&worth_in_words(worth));
    }
    text.push_str(&called_in_words(scene.called()));
    text.push_str("\nalways simulated for this vehicle:\n");
    for (stage, name) in simulation.base_systems() {
        append(&mut text, format_args!("  {:<6} {name}\n", stage.as_str()));
    }
    let added = simulation.added();
    text.push_str(if added.is_empty() { "\nno effects\n" } else { "\neffects of the scene:\n" });
    for effect in added {
        text.push_str(&in_words(effect));
    }
    text.push_str("\nnot simulated:\n");
    for kind in left_out(added) {
        append(&mut text, format_args!("  {:<22} {}\n", kind, summary(kind)));
    }
    show(&text);
    Ok(failure::OK)
}

/// Text about the effects that aren't simulated.
fn left_out(added: &[Added]) -> impl Iterator<Item = &'static str> {
    let names = EFFECTS.iter().map(|kind| kind.name());
    names.filter(|name| added.iter().all(|effect| effect.effect != *name))
}

fn summary(effect: &str) -> &'static str {
    EFFECTS.iter().find(|kind| kind.name() == effect).map_or("", |kind| kind.summary())
}

fn in_json(scene: &Scene, simulation: &Simulation, worth: Option<&EffectInfluence>) -> Value {
    let system = |(stage, name): &(Stage, String)| json!({"stage": stage.as_str(), "system": name});
    let effect = |effect: &Added| {
        json!({
            "effect": effect.effect,
            "systems": effect.systems.iter().map(system).collect::<Vec<_>>(),
            "replaces": effect.replaces,
            "components": effect.components.iter().map(|(name, on)| json!({"component": name, "sensors": on})).collect::<Vec<_>>(),
            "streams": effect.streams, "trajectory": effect.trajectory,
        })
    };
    let called = |called: &Called| json!({"effect": called.effect, "by": called.by, "fate": called.fate.as_str(), "tables": called.tables});
    json!({
        "scene": scene.name, "seed": scene.seed, "duration_s": simulation.duration_s(),
        "base": simulation.base_systems().iter().map(system).collect::<Vec<_>>(),
        "effects": simulation.added().iter().map(effect).collect::<Vec<_>>(),
        "left_out": left_out(simulation.added()).collect::<Vec<_>>(),
        "called": scene.called().iter().map(called).collect::<Vec<_>>(),
        "worth": worth.map(worth_in_json),
    })
}

fn worth_in_json(worth: &EffectInfluence) -> Value {
    let mean = |mean: &Mean| json!({"mean": mean.mean, "half": mean.half.is_finite().then_some(mean.half)});
    let left_out = |out: &LeftOut| {
        json!({
            "effects": out.effects, "price_ns": mean(&out.price_ns), "hole_m": mean(&out.hole_m),
            "passed_share": mean(&out.passed), "is_free": out.is_free(),
        })
    };
    json!({
        "seeds": worth.seeds, "way_m": worth.way_m, "hole_m": mean(&worth.hole_m), "passed_share": mean(&worth.passed),
        "all_ns": mean(&worth.all_ns), "spared": left_out(&worth.spared),
        "each": worth.each.iter().map(left_out).collect::<Vec<_>>(),
    })
}

/// Text about the cost of each effect and its influence on the results. The text begins with the cheapest set of
/// effects that keeps the hole diameter D and the passed share within their limits. Each effect follows, the most
/// expensive first.
fn worth_in_words(worth: &EffectInfluence) -> String {
    let kept =
        worth.each.iter().flat_map(|out| &out.effects).filter(|name| !worth.spared.effects.contains(name));
    let names = |names: Vec<&str>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let (kept, spared) = (names(kept.copied().collect()), names(worth.spared.effects.clone()));
    let dear = |mean: &Mean| plus_minus(mean, 1.0, 0);
    let metres = |mean: &Mean| plus_minus(mean, 1.0, 4);
    let percent = |mean: &Mean| plus_minus(mean, 100.0, 2);
    let mut text = format!(
        "\nworth, {} seeds, means with 95 % confidence intervals:\n  all effects: {} ns per return, D {} m, passed {} % of {:.1} m\n  \
         the cheapest sufficient set: {kept}\n  \
         effects left out: {spared}\n    saves {} ns per return; changes D by {} m (within {HOLE_LIMIT_M} m) and the passed share by \
         {} % (within {:.0} %)\n\n  {:<22}{:>COLUMN$}{:>COLUMN$}{:>COLUMN$}\n",
        worth.seeds,
        dear(&worth.all_ns),
        metres(&worth.hole_m),
        percent(&worth.passed),
        worth.way_m,
        dear(&worth.spared.price_ns),
        metres(&worth.spared.hole_m),
        percent(&worth.spared.passed),
        PASSED_LIMIT * 100.0,
        "left out",
        "saves, ns per return",
        "changes D by, m",
        "passed by, %",
    );
    for out in &worth.each {
        let matters = if out.is_free() { "" } else { "  matters or may matter" };
        append(
            &mut text,
            format_args!(
                "  {:<22}{:>COLUMN$}{:>COLUMN$}{:>COLUMN$}{matters}\n",
                out.effects.join(", "),
                dear(&out.price_ns),
                metres(&out.hole_m),
                percent(&out.passed)
            ),
        );
    }
    text
}

/// A mean with its confidence interval, both multiplied by `scale`.
fn plus_minus(mean: &Mean, scale: f64, digits: usize) -> String {
    format!("{:.digits$} +- {:.digits$}", mean.mean * scale, mean.half * scale)
}

fn called_in_words(called: &[Called]) -> String {
    let mut text = String::from("\nthe scene calls for:\n");
    for call in called {
        append(
            &mut text,
            format_args!("  {:<22} {:<10} {}\n", call.effect, call.fate.as_str(), by(&call.by)),
        );
    }
    text
}

/// Reasons why the scene calls for an effect, as text. Only the first three are listed.
fn by(callers: &[String]) -> String {
    const SHOWN: usize = 3;
    let shown = callers.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join("; ");
    match callers.len().checked_sub(SHOWN) {
        Some(more) if more > 0 => format!("{shown}; and {more} more"),
        _ => shown,
    }
}

fn in_words(added: &Added) -> String {
    let mut text = format!("  {}: {}\n", added.effect, summary(added.effect));
    let mut line = |what: &str, words: String| append(&mut text, format_args!("    {what:<10} {words}\n"));
    for (stage, name) in &added.systems {
        line("system", format!("{name} in {}", stage.as_str()));
    }
    for base in &added.replaces {
        line("replaces", (*base).to_owned());
    }
    for (component, sensors) in &added.components {
        line("component", format!("{component} on {}", sensors.join(", ")));
    }
    if !added.streams.is_empty() {
        line("random", format!("one stream each for {}", added.streams.join(", ")));
    }
    if let Some(what) = &added.trajectory {
        line("trajectory", what.clone());
    }
    text
}
