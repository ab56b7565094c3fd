//! Published colours of skin, against which the look-up is checked.

/// A published colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedColor {
    /// Whose skin, where.
    pub name: &'static str,
    /// Who published it.
    pub source: Source,
    /// CIELAB under D65.
    pub lab: [f64; 3],
}

/// Where a colour was published.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Xiao et al. 2017, "Characterising the variations in ethnic skin colours": means of 187 Caucasian, 202 Chinese,
    /// 145 Kurdish and 426 Thai subjects, each with a standard deviation of 3 to 5.5 in L*, 1.6 to 3.1 in a* and 1.4
    /// to 2.9 in b*.
    Xiao2017,
    /// de Rigal et al. 2010, read from its graphs: uncertain by some 2 units.
    DeRigal2010,
    /// The two skin patches of the ColorChecker (McCamy, Marcus and Davidson 1976), by their sRGB values.
    ColorChecker,
    /// The Monk scale (Monk 2019), by its sRGB values: tones 7 and 8. Its lighter tones are paler and yellower and its
    /// darkest greyer than any measured skin.
    Monk2019,
}

impl Source {
    /// Largest CIEDE2000 distance of a colour to the nearest one of the model.
    ///
    /// The model meets measured means within their standard error of about 2. The graphs' two lightest points are
    /// yellower and redder than any other published skin, and so is the light patch of the chart, which is painted. The
    /// tones of the scale are met within a just noticeable difference.
    pub fn tolerance(self) -> f64 {
        match self {
            Self::Xiao2017 => 2.1,
            Self::DeRigal2010 => 5.5,
            Self::ColorChecker => 4.5,
            Self::Monk2019 => 1.0,
        }
    }
}

const fn color(source: Source, name: &'static str, lab: [f64; 3]) -> PublishedColor {
    PublishedColor { name, source, lab }
}

/// Twenty colours from L* = 31 to 66.
pub const PUBLISHED: [PublishedColor; 20] = {
    use Source::{ColorChecker, DeRigal2010, Monk2019, Xiao2017};
    [
        color(Xiao2017, "Caucasian forearm", [63.0, 5.6, 14.0]),
        color(Xiao2017, "Caucasian forehead", [59.2, 11.6, 15.1]),
        color(Xiao2017, "Caucasian cheek", [59.6, 11.8, 14.6]),
        color(Xiao2017, "Chinese forearm", [60.9, 7.0, 15.0]),
        color(Xiao2017, "Chinese forehead", [56.4, 11.7, 16.3]),
        color(Xiao2017, "Chinese cheek", [58.9, 11.4, 14.2]),
        color(Xiao2017, "Kurdish forearm", [60.6, 6.5, 16.4]),
        color(Xiao2017, "Kurdish forehead", [56.1, 11.3, 16.4]),
        color(Xiao2017, "Kurdish cheek", [58.0, 11.7, 15.8]),
        color(Xiao2017, "Thai forearm", [61.9, 7.1, 17.4]),
        color(Xiao2017, "Thai forehead", [56.8, 11.6, 17.7]),
        color(Xiao2017, "Thai cheek", [60.7, 10.5, 17.2]),
        color(DeRigal2010, "African-American forehead", [44.0, 14.0, 19.0]),
        color(DeRigal2010, "African-American cheek", [48.0, 15.0, 20.0]),
        color(DeRigal2010, "Mexican forehead", [58.0, 15.0, 21.0]),
        color(DeRigal2010, "Mexican cheek", [63.0, 16.0, 21.0]),
        color(ColorChecker, "light skin", [65.7, 13.7, 16.9]),
        color(ColorChecker, "dark skin", [38.0, 11.8, 13.7]),
        color(Monk2019, "tone 7", [42.5, 12.3, 20.5]),
        color(Monk2019, "tone 8", [30.7, 11.7, 13.3]),
    ]
};
