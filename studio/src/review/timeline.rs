//! The run as an OpenTimelineIO file, for RV, xSTUDIO and editing programs: one clip whose media are the frames, or the
//! video, with the marks of the performance.
//!
//! Written to the schemas of OpenTimelineIO 0.17 ("OpenTimelineIO Serialized Schema", opentimelineio.readthedocs.io);
//! addresses of media are relative to the file, so the folder can be moved. Times count from 0, frames of the files from 1.

use rubor_rig::timeline::Sequence;
use serde_json::{Value, json};

use super::marks::{self, Mark};

/// Name of the file in the folder of a run.
pub const TIMELINE_FILE: &str = "sequence.otio";

/// What the clip of a run is made of.
#[derive(Clone, Debug)]
pub struct Clip<'a> {
    /// Name of the run.
    pub name: &'a str,
    /// First and last frame that there are, from 1.
    pub frames: [u32; 2],
    /// The video, if there is one: its name, relative to the file.
    pub video: Option<&'a str>,
}

/// The timeline of a run.
pub fn of(sequence: &Sequence, clip: &Clip<'_>) -> Value {
    let rate = sequence.fps;
    let [first, last] = clip.frames;
    let time =
        |value: u32| json!({ "OTIO_SCHEMA": "RationalTime.1", "rate": rate, "value": f64::from(value) });
    let range = |start: u32, duration: u32| json!({ "OTIO_SCHEMA": "TimeRange.1", "start_time": time(start), "duration": time(duration) });
    let all = range(0, last + 1 - first);
    let mut media = json!({
        "DEFAULT_MEDIA": {
            "OTIO_SCHEMA": "ImageSequenceReference.1", "metadata": {}, "name": "frames",
            "available_range": all, "available_image_bounds": null,
            "target_url_base": "./", "name_prefix": "frame.", "name_suffix": ".png",
            "start_frame": first, "frame_step": 1, "rate": rate, "frame_zero_padding": 4,
            // Where only some frames were drawn, the one before stays.
            "missing_frame_policy": "hold",
        }
    });
    if let Some(video) = clip.video {
        media["video"] = json!({
            "OTIO_SCHEMA": "ExternalReference.1", "metadata": {}, "name": "video",
            "available_range": all, "available_image_bounds": null, "target_url": video,
        });
    }
    let marker = |mark: &Mark| {
        json!({
            "OTIO_SCHEMA": "Marker.2", "metadata": { "rubor": { "subject": mark.subject, "peak": mark.is_peak } },
            "name": mark.name, "color": if mark.is_peak { "RED" } else { "CYAN" }, "comment": "",
            "marked_range": range(mark.frame - first, mark.frames),
        })
    };
    let is_within = |mark: &&Mark| mark.frame >= first && mark.frame <= last;
    let markers: Vec<Value> = marks::of(sequence).iter().filter(is_within).map(marker).collect();
    let item = |schema: &str, name: &str| {
        json!({
            "OTIO_SCHEMA": schema, "metadata": {}, "name": name, "source_range": null, "effects": [],
            "markers": [], "enabled": true, "color": null,
        })
    };
    let mut shot = item("Clip.2", clip.name);
    shot["markers"] = markers.into();
    shot["media_references"] = media;
    shot["active_media_reference_key"] = "DEFAULT_MEDIA".into();
    let mut track = item("Track.1", "frames");
    track["kind"] = "Video".into();
    track["children"] = json!([shot]);
    let mut stack = item("Stack.1", "tracks");
    stack["children"] = json!([track]);
    json!({
        "OTIO_SCHEMA": "Timeline.1",
        "metadata": { "rubor": { "version": env!("CARGO_PKG_VERSION"), "description": sequence.description } },
        "name": clip.name, "global_start_time": null, "tracks": stack,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_stand_at_their_frames_within_what_was_drawn() {
        let text = r#"{ "fps": 10, "duration": 2, "expressions": {
            "joy": [{ "t": 0.2, "v": 0 }, { "t": 0.5, "v": 1 }, { "t": 0.9, "v": 1 }, { "t": 1.2, "v": 0 }] } }"#;
        let sequence = Sequence::from_json("s.json", text).unwrap();
        let timeline = of(&sequence, &Clip { name: "shot", frames: [4, 11], video: Some("video.mp4") });
        let clip = &timeline["tracks"]["children"][0]["children"][0];
        let markers = clip["markers"].as_array().unwrap();
        // Frame 3 is before the first and frame 13 after the last frame that was drawn.
        assert_eq!(markers.len(), 1);
        assert_eq!((&markers[0]["name"], &markers[0]["color"]), (&"joy 1.00".into(), &"RED".into()));
        let range = &markers[0]["marked_range"];
        assert_eq!((&range["start_time"]["value"], &range["duration"]["value"]), (&2.0.into(), &5.0.into()));
        let frames = &clip["media_references"]["DEFAULT_MEDIA"];
        assert_eq!((&frames["start_frame"], &frames["rate"]), (&4.into(), &10.0.into()));
        assert_eq!(frames["available_range"]["duration"]["value"], 8.0);
        assert_eq!(clip["media_references"]["video"]["target_url"], "video.mp4");
    }
}
