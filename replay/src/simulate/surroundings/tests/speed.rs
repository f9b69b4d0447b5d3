//! How long a ray takes. Run in release: `cargo test --release -p headrace_replay surroundings::tests::speed -- --ignored
//! --nocapture`.

#![expect(clippy::disallowed_methods, clippy::print_stdout, reason = "this measures time, and tells it")]

use std::time::Instant;

use super::*;

const RAYS: u32 = 200_000;

fn time(name: &str, surroundings: &Surroundings, s: [f64; 2]) {
    let mut lcg = Lcg(50);
    let rays: Vec<_> = (0..10_000)
        .map(|_| {
            let chainage = lcg.between(s[0], s[1]);
            let place = surroundings.axis().place(chainage, [lcg.between(-1.0, 1.0), lcg.between(2.5, 4.0)]);
            let heading = surroundings.axis().heading_rad(chainage);
            let across = lcg.between(0.0, math::TAU);
            // A profiler's rays: across the tunnel.
            let (sin, cos) = math::sin_cos(across);
            (place, Vec3::new(-math::sin(heading) * sin, math::cos(heading) * sin, cos), lcg.direction())
        })
        .collect();
    let run = |cast: &dyn Fn(usize) -> f64| {
        let begin = Instant::now();
        let sum: f64 = (0..RAYS as usize).map(cast).sum();
        assert!(sum > 0.0);
        begin.elapsed().as_secs_f64() * 1e9 / f64::from(RAYS)
    };
    let ray = |k: usize| rays[k % rays.len()];
    let across = run(&|k| surroundings.range_m(ray(k).0, ray(k).1, 20.0).unwrap_or(0.0));
    let full = run(&|k| surroundings.cast(ray(k).0, ray(k).1, 20.0).map_or(0.0, |hit| hit.range_m));
    let any = run(&|k| surroundings.range_m(ray(k).0, to_vec(ray(k).2), 20.0).unwrap_or(0.0));
    println!("{name:24} range across {across:7.0} ns, cast across {full:7.0} ns, range any way {any:7.0} ns");
}

#[test]
#[ignore = "a measurement, for a release build"]
fn nanoseconds_a_ray() {
    let design = named::ceran().unwrap();
    let long = |text: &str| {
        let root = Document::new("s.toml", text).root().unwrap();
        let (no_text, no_file) = (|_: &str| Err(String::new()), |_: &str| Err(String::new()));
        Surroundings::parse(root.section("tunnel").unwrap(), &design, 7000.0, &no_text, &no_file).unwrap()
    };
    let section = |k: usize| {
        let angle = k as f64;
        let (sin, cos) = math::sin_cos(angle);
        design.cast([0.5, 3.0], [sin, cos]).map_or(0.0, |hit| hit.range_m)
    };
    let begin = Instant::now();
    let sum: f64 = (0..RAYS as usize).map(section).sum();
    println!("Profile::cast {:.0} ns ({sum:.0})", begin.elapsed().as_secs_f64() * 1e9 / f64::from(RAYS));
    time("plain", &Surroundings::straight(design.clone()), [0.0, 7000.0]);
    let boulders = "[[tunnel.features]]\nkind = \"boulders\"\nfrom_m = 0\nto_m = 7000\ncount = 10000\nsize_m = [0.1, 2]\n";
    time("10,000 boulders", &long(boulders), [0.0, 7000.0]);
    let bulge =
        "[[tunnel.features]]\nkind = \"bulge\"\nchainage_m = 100\nlength_m = 6\nwidth_m = 5\ndepth_m = 1\n";
    time("within a bulge's length", &long(bulge), [98.0, 102.0]);
    time("far from a bulge", &long(bulge), [200.0, 300.0]);
    let bend = "[[tunnel.axis]]\nlength_m = 200\n[[tunnel.axis]]\nradius_m = 60\nturn_deg = -35\n";
    time("in a bend", &long(bend), [202.0, 234.0]);
    time("straight, bend elsewhere", &long(bend), [20.0, 150.0]);
    time("bulge in a bend", &long(&(bend.to_owned() + &bulge.replace("100", "215"))), [213.0, 217.0]);
    let stations = "[[tunnel.stations]]\nchainage_m = 50\nscale = 1.0\n[[tunnel.stations]]\nchainage_m = 80\nscale = 1.2\n";
    time("between stations", &long(stations), [52.0, 78.0]);
}
