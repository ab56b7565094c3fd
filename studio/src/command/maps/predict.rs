//! `rubor maps predict`: distributions and wrinkle weights from the strain of expressions.

use std::path::PathBuf;

use clap::Args;
use rubor_assets::convert::into_head::{self, Origin};
use rubor_assets::convert::prediction::{KnownState, Prediction, correlation, fit, predict};
use rubor_assets::convert::skin_texels::SkinTexels;
use rubor_rig::bind::BoundRig;
use rubor_rig::deform::deform_points;
use rubor_rig::expression::Rig;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, ProvenanceKind};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;
use rubor_rig::strain::StrainModel;
use serde_json::{Value, json};

use super::destination::write_head;
use super::transfer::mean_of;
use rubor::inputs;
use rubor::notes::Note;
use rubor::{Failure, Outcome};

/// Predicted wrinkle weights below this stay out of a rig: geometry is never quite still.
const LEAST_WRINKLE: f32 = 0.05;

/// Arguments of `rubor maps predict`.
#[derive(Debug, Args)]
pub(crate) struct PredictArgs {
    /// Head whose geometry is predicted from (.glb, .gltf); reports the agreement with its own maps
    head: PathBuf,
    /// Rig whose expressions are predicted [default: the head's, else the default one]
    #[arg(long)]
    rig: Option<PathBuf>,
    /// Coefficients (JSON), such as {"bias_per_compression": 0.6}
    #[arg(long)]
    model: Option<PathBuf>,
    /// Fit the coefficients of blood to the distributions that the head has, and predict with these
    #[arg(long)]
    fit: bool,
    /// Write a head (.glb) with the distributions and wrinkle weights that it lacked
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Replace distributions that the head has
    #[arg(long, requires = "output")]
    replace: bool,
    /// Smaller head file: maps as JPEG, no normals of shapes for other viewers
    #[arg(long)]
    small: bool,
}

/// An expression on the head.
struct Expression {
    name: String,
    face: FaceState,
    prediction: Prediction,
}

pub(super) fn run(a: &PredictArgs, notes: &mut Vec<Note>) -> Outcome<Value> {
    let mut loaded = inputs::head(Some(&a.head))?;
    notes.extend(loaded.notes.iter().cloned());
    let mut rig = inputs::rig(a.rig.as_deref(), loaded.rig.clone())?;
    let mut model = model(a)?;
    let mean = mean_of(&loaded.head)?;
    if a.fit {
        model = fitted(&loaded.head, &rig, &model, &mean)?;
    }
    let expressions = expressions(&loaded.head, &rig, &model, &mean)?;
    if expressions.is_empty() {
        return Err(Failure::input("the rig has no expression, so there is nothing to predict"));
    }
    let mut report = agreement(&loaded.head, &expressions, &mean);
    report["model"] = serde_json::to_value(model).map_err(Failure::job)?;
    let Some(output) = &a.output else { return Ok(report) };
    if output.extension().is_none_or(|e| e != "glb") {
        return Err(Failure::input(format!("{}: expected a name that ends in .glb", output.display())));
    }
    let head = &mut loaded.head;
    let mut predicted = Vec::new();
    for expression in expressions {
        let name = expression.name;
        let Some(written) = rig.expressions.get_mut(&name) else { continue };
        for (zone, weight) in head.maps.zones.iter().zip(&expression.prediction.zone_weights) {
            if *weight > LEAST_WRINKLE && !written.wrinkles.contains_key(&zone.name) {
                written.wrinkles.insert(zone.name.clone(), *weight);
            }
        }
        if written.hemoglobin.is_empty() {
            written.hemoglobin.insert(name.clone(), 1.0);
        }
        if a.replace || head.maps.distributions.iter().all(|d| d.name != name) {
            predicted.push(expression.prediction.distribution);
        }
    }
    report["predicted_distributions"] = json!(predicted.iter().map(|d| &d.name).collect::<Vec<_>>());
    let stamp = model.provenance("maps.distributions");
    let origin = Origin { kind: ProvenanceKind::Predicted, source: stamp.source, licence: stamp.licence };
    if !predicted.is_empty() {
        into_head::put_given_distributions(head, predicted, mean, &origin);
    }
    loaded.rig = Some(rig);
    write_head(&loaded, output, a.small)?;
    report["written"] = json!(output);
    Ok(report)
}

fn model(a: &PredictArgs) -> Outcome<StrainModel> {
    let Some(file) = &a.model else { return Ok(StrainModel::default()) };
    let text = rubor_rig::limits::read_to_string(file)
        .map_err(|e| Failure::input(format!("{}: cannot be read: {e}", file.display())))?;
    serde_json::from_str(&text).map_err(|e| Failure::input(format!("{}: {e}", file.display())))
}

/// The model with coefficients from the expressions that have a distribution of their name.
fn fitted(head: &Head, rig: &Rig, model: &StrainModel, mean: &Map) -> Outcome<StrainModel> {
    let expressions = expressions(head, rig, model, mean)?;
    let known = |e: &Expression| {
        let distribution = head.maps.distributions.iter().find(|d| d.name == e.name)?;
        let deformed = deform_points(&head.mesh, &head.shapes, &e.face.shapes);
        Some(KnownState { deformed, distribution })
    };
    let states: Vec<_> = expressions.iter().filter_map(known).collect();
    if states.is_empty() {
        return Err(Failure::input(
            "--fit: found no distribution with the name of an expression, expected one",
        ));
    }
    Ok(fit(head, model, &states, mean))
}

/// Every expression of a rig at full weight, alone.
fn expressions(head: &Head, rig: &Rig, model: &StrainModel, mean: &Map) -> Outcome<Vec<Expression>> {
    let (bound, _) = BoundRig::new(head, rig)?;
    let names: Vec<String> = bound.expression_names().map(str::to_owned).collect();
    let one = |(i, name): (usize, String)| {
        let mut weights = bound.neutral_weights();
        weights.expressions[i] = 1.0;
        let face = bound.face(&weights);
        let deformed = deform_points(&head.mesh, &head.shapes, &face.shapes);
        let prediction = predict(head, model, &name, &deformed, mean);
        Expression { name, face, prediction }
    };
    Ok(names.into_iter().enumerate().map(one).collect())
}

/// Correlation of predictions with the head's own data, expression by expression and zone by zone.
fn agreement(head: &Head, expressions: &[Expression], mean: &Map) -> Value {
    let skin = SkinTexels::new(head, mean.width, mean.height).mask();
    let ratio = |bias: &Map| on_skin(bias, mean, &skin, |b, m| b / m.max(1e-6));
    let scale = |map: &Map| on_skin(map, mean, &skin, |s, _| s);
    let (mut all_own, mut all_predicted) = (Vec::new(), Vec::new());
    let mut rows = Vec::new();
    for e in expressions {
        let mut row = json!({ "name": e.name });
        if let Some(own) = head.maps.distributions.iter().find(|d| d.name == e.name) {
            let predicted = &e.prediction.distribution;
            let (a, b) = (ratio(&own.bias), ratio(&predicted.bias));
            row["bias_correlation"] = rounded(correlation(&a, &b));
            row["scale_correlation"] = rounded(correlation(&scale(&own.scale), &scale(&predicted.scale)));
            all_own.extend(a);
            all_predicted.extend(b);
        }
        row["wrinkle_correlation"] = rounded(correlation(&e.face.zones, &e.prediction.zone_weights));
        rows.push(row);
    }
    let zone = |i: usize| {
        let own: Vec<f32> = expressions.iter().map(|e| e.face.zones[i]).collect();
        let predicted: Vec<f32> = expressions.iter().map(|e| e.prediction.zone_weights[i]).collect();
        json!({ "name": head.maps.zones[i].name, "wrinkle_correlation": rounded(correlation(&own, &predicted)) })
    };
    let zones: Vec<Value> = (0..head.maps.zones.len()).map(zone).collect();
    let own: Vec<f32> = expressions.iter().flat_map(|e| e.face.zones.iter().copied()).collect();
    let predicted: Vec<f32> =
        expressions.iter().flat_map(|e| e.prediction.zone_weights.iter().copied()).collect();
    json!({
        "bias_correlation": rounded(correlation(&all_own, &all_predicted)),
        "wrinkle_correlation": rounded(correlation(&own, &predicted)),
        "expressions": rows,
        "zones": zones,
    })
}

/// A value for each skin texel of the mean from a map of any size.
fn on_skin(map: &Map, mean: &Map, skin: &Mask, value: impl Fn(f32, f32) -> f32) -> Vec<f32> {
    let at = |i: usize| {
        let u = ((i as u32 % mean.width) as f32 + 0.5) / mean.width as f32;
        let v = ((i as u32 / mean.width) as f32 + 0.5) / mean.height as f32;
        value(map.sample(u, v, 0), mean.values[i])
    };
    (0..mean.values.len()).filter(|i| skin.mapped[*i]).map(at).collect()
}

fn rounded(value: Option<f64>) -> Value {
    value.map_or(Value::Null, |v| json!((v * 1000.0).round() / 1000.0))
}
