//! Attributes of blend shapes, tweak nodes and animation curves.

use std::collections::BTreeMap;

use super::{Attribute, Parser};
use crate::ascii::scene::{BlendShapeData, CurveData, TweakData};
use crate::ascii::words::short;
use crate::error::Fault;

impl Parser<'_> {
    pub(super) fn fill_tweak(
        &mut self,
        tweak: &mut TweakData,
        attribute: &Attribute<'_>,
    ) -> Result<(), Fault> {
        let metres = self.scene.metres;
        match attribute.key().as_str() {
            "vl.vt" | "pl.cp" => {
                let moves = tweak.moves.entry(attribute.index(0)).or_default();
                let mut index = attribute.index(1);
                while let Some(offset) = self.next_triple()? {
                    moves.insert(index, offset.map(|c| (c * metres) as f32));
                    index = index.saturating_add(1);
                }
            }
            "vl.vt.px" | "vl.vt.py" | "vl.vt.pz" | "pl.cp.px" | "pl.cp.py" | "pl.cp.pz" => {
                let moves = tweak.moves.entry(attribute.index(0)).or_default();
                self.components_of(moves, attribute.index(1), axis(attribute))?;
            }
            "rtw" => tweak.relative = self.flag_on()?,
            _ => {}
        }
        Ok(())
    }

    /// One coordinate of points from an index on.
    pub(super) fn components_of(
        &mut self,
        moves: &mut BTreeMap<u32, [f32; 3]>,
        from: u32,
        axis: usize,
    ) -> Result<(), Fault> {
        let mut index = from;
        while let Some(value) = self.number()? {
            moves.entry(index).or_default()[axis] = (value * self.scene.metres) as f32;
            index = index.saturating_add(1);
        }
        Ok(())
    }

    /// The numbers that are left of the statement.
    fn numbers(&mut self) -> Result<Vec<f64>, Fault> {
        let mut numbers = Vec::new();
        while let Some(number) = self.number()? {
            numbers.push(number);
        }
        Ok(numbers)
    }

    /// `yes no yes` from an index on.
    fn flags(&mut self, into: &mut BTreeMap<u32, bool>, from: u32) -> Result<(), Fault> {
        let mut index = from;
        while !self.lexer.at_end()? {
            into.insert(index, self.flag_on()?);
            index = index.saturating_add(1);
        }
        Ok(())
    }

    pub(super) fn fill_blend_shape(
        &mut self,
        shape: &mut BlendShapeData,
        attribute: &Attribute<'_>,
        line: usize,
    ) -> Result<(), Fault> {
        match attribute.key().as_str() {
            "w" => {
                let Some((from, _)) = attribute.last().1 else { return Ok(()) };
                let mut index = from;
                while let Some(weight) = self.number()? {
                    shape.weights.insert(index, weight);
                    index = index.saturating_add(1);
                }
            }
            "it.itg.iti.ipt" => {
                let key = (attribute.index(0), attribute.index(1), attribute.index(2));
                let item = shape.items.entry(key).or_default();
                item.line = line;
                let Some(_count) = self.number()? else { return Ok(()) };
                item.offsets.clear();
                // A pointArray has four numbers a point and no unit: Maya's own, the centimetre.
                while let Some(offset) = self.next_triple()? {
                    self.needed()?;
                    item.offsets.push(offset.map(|c| (c * 0.01) as f32));
                }
            }
            "it.itg.iti.ict" => {
                let key = (attribute.index(0), attribute.index(1), attribute.index(2));
                let (points, _) = self.components("vtx", line)?;
                shape.items.entry(key).or_default().points = points;
            }
            "it.bw" => {
                let values = self.numbers()?.into_iter().map(|v| v as f32).collect();
                let painted = shape.base_weights.entry(attribute.index(0)).or_default();
                painted.blocks.push((attribute.index(1), values));
            }
            "it.itg.tw" => {
                let values = self.numbers()?.into_iter().map(|v| v as f32).collect();
                let key = (attribute.index(0), attribute.index(1));
                let painted = shape.target_weights.entry(key).or_default();
                painted.blocks.push((attribute.index(2), values));
            }
            "it.itg.pdm" => {
                let follows = self.count("mode")? > 0;
                shape.post_deformed.extend(follows.then(|| attribute.index(1)));
            }
            "tgvs" => self.flags(&mut shape.visible, attribute.index(0))?,
            "tpvs" => self.flags(&mut shape.parent_visible, attribute.index(0))?,
            "pndr" => {
                for (index, group) in (attribute.index(0)..).zip(self.numbers()?) {
                    shape.group_of.insert(index, group.clamp(0.0, 1e9) as u32);
                }
            }
            "tgdt.pnid" => {
                let group = self.count("group")?;
                shape.group_parents.insert(attribute.index(0), group);
            }
            "tgdt.dwgh" => {
                shape.group_weights.insert(attribute.index(0), self.needed()?);
            }
            "ibig.ibi.ibvs" => {
                let shown = self.flag_on()?;
                shape.hidden_items.insert((attribute.index(0), attribute.index(1)), !shown);
            }
            "ibig.ibi.ibtn" => {
                if let Some(name) = self.text()? {
                    shape.item_names.insert((attribute.index(0), attribute.index(1)), name);
                }
            }
            "aal" => {
                while let (Some(alias), Some(of)) = (self.text()?, self.text()?) {
                    let index = of
                        .strip_prefix("weight[")
                        .or_else(|| of.strip_prefix("w["))
                        .and_then(|t| t.strip_suffix(']'))
                        .and_then(|t| t.parse().ok());
                    if let Some(index) = index {
                        shape.aliases.insert(index, alias);
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }

    pub(super) fn fill_curve(
        &mut self,
        curve: &mut CurveData,
        attribute: &Attribute<'_>,
    ) -> Result<(), Fault> {
        let from = attribute.last().1.map(|r| r.0);
        let key = attribute.key();
        match (key.as_str(), from) {
            ("ktv", Some(from)) => {
                let mut index = from;
                while let Some(time) = self.number()? {
                    curve.keys.insert(index, [time, self.needed()?]);
                    index = index.saturating_add(1);
                }
            }
            ("kit" | "kot", Some(from)) => {
                let types = if key == "kit" { &mut curve.in_types } else { &mut curve.out_types };
                let mut index = from;
                while let Some(kind) = self.number()? {
                    types.insert(index, kind as u32);
                    index = index.saturating_add(1);
                }
            }
            ("kix" | "kiy" | "kox" | "koy", Some(from)) => {
                let values = match key.as_str() {
                    "kix" => &mut curve.in_x,
                    "kiy" => &mut curve.in_y,
                    "kox" => &mut curve.out_x,
                    _ => &mut curve.out_y,
                };
                let mut index = from;
                while let Some(value) = self.number()? {
                    values.insert(index, value);
                    index = index.saturating_add(1);
                }
            }
            ("tan", None) => curve.default_tangent = self.count("tangent type")?,
            ("wgt", None) => curve.weighted = self.flag_on()?,
            ("pre", None) => curve.pre_infinity = self.count("infinity")?,
            ("pst", None) => curve.post_infinity = self.count("infinity")?,
            _ => {}
        }
        Ok(())
    }
}

/// 0, 1 or 2 for an attribute that ends in `.px`, `.py` or `.pz`.
pub(super) fn axis(attribute: &Attribute<'_>) -> usize {
    match short(attribute.last().0) {
        "py" => 1,
        "pz" => 2,
        _ => 0,
    }
}
