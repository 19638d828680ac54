//! The layout in which a viewer opens the stream: what is where, and how views are set up.

use super::{APPLICATION, TIMELINE, below, path, single};
use crate::output::picture::{ClosurePicture, Picture};
use rerun::blueprint::components::{BackgroundKind, PanelState, PlayState, TextLogColumn};
use rerun::blueprint::datatypes::{self, TextLogColumnKind};
use rerun::blueprint::{
    Blueprint, BlueprintPanel, ContainerLike, Grid, Horizontal, SelectionPanel, Spatial3DView, Tabs, TextDocumentView, TextLogView,
    TimePanel, TimeSeriesView, Vertical,
};
use rerun::external::re_log_types::{BlueprintActivationCommand, EntityPath, LogMsg};
use rerun::external::re_sdk_types::blueprint::archetypes::{Background, EyeControls3D, LineGrid3D, PlotLegend, TextLogColumns};
use rerun::{AsComponents, RecordingStream, RecordingStreamBuilder, RecordingStreamResult};

/// Background of the 3D view: dark and bright ends of the colour map stand out from it.
const SKY: [u8; 3] = [170, 176, 184];
/// Most hinges and closures whose plots are all open at once; with more, each has a tab.
const OPEN_PLOTS: usize = 3;

/// A hinge or closure with plots of its load.
struct Plotted<'p> {
    group: &'static str,
    name: &'p str,
    side: &'p str,
    /// Entity, words and unit of each plot.
    quantities: Vec<(&'static str, &'static str, &'static str)>,
}

/// What has plots, two each and in this order; gears, which have one, come last.
fn plotted<'p>(picture: &'p Picture) -> Vec<Plotted<'p>> {
    let spatial = || vec![("moment", "moment", "N m"), ("force", "force", "N")];
    let hinges = picture.hinges.iter().filter(|h| h.carries);
    let hinges = hinges.map(|h| Plotted { group: "loads", name: &h.name, side: &h.side, quantities: spatial() });
    let of_closure = |c: &'p ClosurePicture, quantities| Plotted { group: "closures", name: &c.name, side: &c.side, quantities };
    let joints = picture.closures.iter().filter(|c| c.gear_unit.is_none()).map(|c| of_closure(c, spatial()));
    let gears = picture.closures.iter().filter_map(|c| {
        let unit = c.gear_unit?;
        let words = if unit == "N" { "force" } else { "moment" };
        Some(of_closure(c, vec![("coordinate_force", words, unit)]))
    });
    hinges.chain(joints).chain(gears).collect()
}

/// Properties of views by entity in the blueprint's store: the blueprint builder has none for these kinds of view.
type Properties = Vec<(EntityPath, Box<dyn AsComponents>)>;

/// The layout: the whole system on the left above legend and events, plots of every load, stress and mode on the right.
fn layout(picture: &Picture, properties: &mut Properties) -> Blueprint {
    let mut set = |view: &ContainerLike, name: &str, property: Box<dyn AsComponents>| {
        if let ContainerLike::View(view) = view {
            properties.push((below(&view.blueprint_path(), name), property));
        }
    };
    let space: ContainerLike = Spatial3DView::new(picture.scene.as_str()).with_origin("/world").into();
    let eye =
        EyeControls3D::new().with_position(single(picture.eye)).with_look_target(single(picture.center)).with_eye_up([0.0_f32, 0.0, 1.0]);
    set(&space, "EyeControls3D", Box::new(eye));
    set(&space, "LineGrid3D", Box::new(LineGrid3D::new().with_visible(false)));
    set(&space, "Background", Box::new(Background::new(BackgroundKind::SolidColor).with_color(SKY)));
    let events: ContainerLike = TextLogView::new("events").with_origin("/events").into();
    let columns = [(TextLogColumnKind::LogLevel, true), (TextLogColumnKind::Body, true)];
    let columns = columns.map(|(kind, visible)| TextLogColumn(datatypes::TextLogColumn { kind, visible: visible.into() }));
    set(&events, "TextLogColumns", Box::new(TextLogColumns::new().with_text_log_columns(columns)));
    let legend: ContainerLike = TextDocumentView::new("legend").with_origin("/legend").into();

    let mut plot = |name: String, origin: EntityPath, named: bool| -> ContainerLike {
        let view: ContainerLike = TimeSeriesView::new(name).with_origin(origin).into();
        // the legend of a small plot hides it; names show under the pointer, colours are in the legend
        set(&view, "PlotLegend", Box::new(PlotLegend::new().with_visible(named)));
        view
    };
    let mut loads = Vec::new();
    for Plotted { group, name, side, quantities } in plotted(picture) {
        let of = |(quantity, words, unit): &(&str, &str, &str)| {
            plot(format!("{name}: {words} {side}, {unit}"), path(&[group, name, quantity]), false)
        };
        loads.push((name, quantities.iter().map(of).collect::<Vec<_>>()));
    }
    let count = loads.len();
    let loads: Option<ContainerLike> = match count {
        0 => None,
        1..=OPEN_PLOTS => Some(Grid::new(loads.into_iter().flat_map(|(_, plots)| plots)).with_grid_columns(2).into()),
        _ => Some(Tabs::new(loads.into_iter().map(|(name, plots)| Vertical::new(plots).with_name(name).into())).into()),
    };
    let stressed = picture.bodies.iter().any(|b| b.surface.as_ref().is_some_and(|s| s.stress));
    let stress = stressed.then(|| plot("von Mises peak, MPa".into(), path(&["stress"]), true));
    let modes = picture.bodies.iter().filter(|b| !b.mode_names.is_empty());
    let modes: Vec<_> = modes.map(|b| plot(format!("{}: modal coordinates", b.name), path(&["modes", &b.name]), false)).collect();
    let modes = (!modes.is_empty()).then(|| Tabs::new(modes).into());
    let lower: Vec<ContainerLike> = stress.into_iter().chain(modes).collect();
    let lower = (!lower.is_empty()).then(|| Horizontal::new(lower).into());
    let shares: Vec<f32> = loads.iter().map(|_| count.min(OPEN_PLOTS) as f32).chain(lower.iter().map(|_| 1.0)).collect();
    let right: Vec<ContainerLike> = loads.into_iter().chain(lower).collect();
    let left = Vertical::new([space, Horizontal::new([legend, events]).into()]).with_row_shares(vec![2.6, 1.0]);
    let columns: Vec<ContainerLike> =
        if right.is_empty() { vec![left.into()] } else { vec![left.into(), Vertical::new(right).with_row_shares(shares).into()] };
    let time = TimePanel::new().with_timeline(TIMELINE).with_state(PanelState::Collapsed).with_play_state(PlayState::Following);
    Blueprint::new(Horizontal::new(columns))
        .with_time_panel(time)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Hidden))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Hidden))
        .with_auto_views(false)
        .with_auto_layout(false)
}

/// Sends the layout with the properties of its views, which are plain data in the blueprint's store.
pub fn send_blueprint(recording: &RecordingStream, picture: &Picture) -> RecordingStreamResult<()> {
    let mut properties = Properties::new();
    let blueprint = layout(picture, &mut properties);
    let (scratch, store) = RecordingStreamBuilder::new(APPLICATION).memory()?;
    blueprint.send(&scratch, Default::default())?;
    let wanted = |m: &LogMsg| m.store_id().kind() == rerun::StoreKind::Blueprint && !matches!(m, LogMsg::BlueprintActivationCommand(_));
    let mut messages: Vec<LogMsg> = store.take().into_iter().filter(wanted).collect();
    let Some(id) = messages.first().map(|m| m.store_id().clone()) else { return Ok(()) };
    let (extra, store) = RecordingStreamBuilder::from_store_id(&id).memory()?;
    extra.set_time_sequence("blueprint", 0);
    properties.iter().try_for_each(|(entity, property)| extra.log(entity.clone(), property.as_ref()))?;
    messages.extend(store.take().into_iter().filter(|m| matches!(m, LogMsg::ArrowMsg(..))));
    recording.send_blueprint(messages, BlueprintActivationCommand { blueprint_id: id, make_active: true, make_default: true });
    Ok(())
}
