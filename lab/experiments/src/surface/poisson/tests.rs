use super::super::{MeshIndex, norm};
use super::*;
use crate::Spread;

fn sphere(count: u32, radius_m: f64) -> Vec<Sample> {
    let sample = |k: u32| {
        let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(count);
        let r = math::sqrt(1.0 - z * z);
        let (sin, cos) = math::sin_cos(2.399_963_229_728_653 * f64::from(k));
        let out = [r * cos, r * sin, z];
        Sample { place: out.map(|c| c * radius_m), normal: out.map(|c| -c) }
    };
    (0..count).map(sample).collect()
}

fn settings(depth: u32) -> Settings {
    Settings { depth, ..Settings::of_paper() }
}

#[test]
fn sphere_is_reproduced_within_a_twentieth_of_a_cell() {
    let surface = Surface::through(&sphere(5000, 3.0), &settings(5)).unwrap();
    let mesh = surface.mesh();
    let spread = Spread::of(mesh.vertices.iter().map(|p| norm(*p) - 3.0));
    assert!(spread.count > 500 && spread.max_m < surface.cell_m() / 20.0, "{spread:?}");
    assert!(surface.value([0.0; 3]) > 0.2 && surface.value([3.4, 0.0, 0.0]) < -0.2);
    // The distance from the centre to the flat triangles is smaller than the sphere's radius.
    assert!(MeshIndex::new(&mesh, 0.2).unwrap().distance_m([0.0; 3]) < 3.0);
}

#[test]
fn sparse_samples_give_a_single_sphere() {
    let surface = Surface::through(&sphere(300, 3.0), &settings(6)).unwrap();
    let spread = Spread::of(surface.mesh().vertices.iter().map(|p| norm(*p) - 3.0));
    assert!(spread.max_m < 0.15, "{spread:?}");
}

#[test]
fn solver_reports_a_residual_above_its_tolerance() {
    let within = |steps_max| Surface::through(&sphere(2000, 1.0), &Settings { steps_max, ..settings(5) });
    assert!(within(299).is_ok());
    let refused = within(3).err();
    assert!(
        matches!(refused, Some(PoissonError::NotSolved { steps: 3, residual }) if residual > 1e-5),
        "{refused:?}"
    );
}

#[test]
fn same_samples_give_bit_identical_surfaces() {
    let samples = sphere(700, 2.0);
    let meshes = [0, 1].map(|_| Surface::through(&samples, &settings(5)).unwrap().mesh());
    assert_eq!(meshes[0], meshes[1]);
}

#[test]
fn scale_and_position_do_not_change_the_surface() {
    let moved: Vec<Sample> = sphere(2000, 2.0)
        .into_iter()
        .map(|s| Sample { place: s.place.map(|c| c * 512.0 + 1e5), normal: s.normal })
        .collect();
    let surface = Surface::through(&moved, &settings(5)).unwrap();
    let off =
        surface.mesh().vertices.iter().map(|p| norm(p.map(|c| (c - 1e5) / 512.0)) - 2.0).collect::<Vec<_>>();
    assert!(Spread::of(off).max_m < 0.01);
}

#[test]
fn input_without_surface_is_refused() {
    let samples = sphere(100, 1.0);
    let refused = |samples: &[Sample], settings: Settings| Surface::through(samples, &settings).err();
    assert_eq!(refused(&[], settings(5)), Some(PoissonError::TooFewSamples { count: 0 }));
    assert_eq!(refused(&[samples[0]; 9], settings(5)), Some(PoissonError::TooFewSamples { count: 9 }));
    assert!(matches!(refused(&samples, settings(1)), Some(PoissonError::Setting { setting: "depth", .. })));
    assert!(matches!(refused(&samples, settings(10)), Some(PoissonError::TooLarge { .. })));
    let nan = Settings { point_weight: f64::NAN, ..settings(4) };
    assert!(matches!(refused(&samples, nan), Some(PoissonError::Setting { setting: "point_weight", .. })));
    let mut broken = samples;
    broken[7].normal[1] = f64::INFINITY;
    assert_eq!(refused(&broken, settings(5)), Some(PoissonError::NotFinite { index: 7 }));
}
