//! The coefficients of the Magic Formula 5.2 under their names in `.tir` files.

use serde::{Deserialize, Serialize};

/// Rule of the standard for a coefficient that a file does not give.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Missing {
    /// The file is of no use without it.
    Refused,
    /// It takes this value.
    Is(f64),
}

macro_rules! coefficients {
    ($($(#[$doc:meta])* $field:ident $key:literal $missing:expr;)* => $(#[$own_doc:meta])* $own:ident) => {
        /// Coefficients of one tyre, or of several side by side. Fields are the keys of a `.tir` file in lower case; see Pacejka for each.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[allow(missing_docs)]
        pub struct Coefficients<T = f64> {
            $($(#[$doc])* pub $field: T,)*
            $(#[$own_doc])* pub $own: T,
        }

        impl Coefficients {
            /// Those of several tyres, side by side.
            pub(super) fn beside<const N: usize>(tyres: [&Self; N]) -> Coefficients<[f64; N]> {
                Coefficients {
                    $($field: tyres.map(|tyre| tyre.$field),)*
                    $own: tyres.map(|tyre| tyre.$own),
                }
            }

            /// Makes the coefficients from a look-up by key.
            ///
            /// # Errors
            /// Required keys that are missing.
            pub(super) fn from_lookup(mut find: impl FnMut(&str) -> Option<f64>) -> Result<Self, Vec<&'static str>> {
                let mut absent = Vec::new();
                $(let $field = find($key).unwrap_or_else(|| match $missing {
                    Missing::Is(value) => value,
                    Missing::Refused => { absent.push($key); f64::NAN }
                });)*
                if absent.is_empty() { Ok(Self { $($field,)* $own: 0.0 }) } else { Err(absent) }
            }

            /// All keys that are understood.
            #[must_use]
            pub fn keys() -> &'static [&'static str] {
                &[$($key),*]
            }
        }
    };
}

use Missing::{Is, Refused};
coefficients! {
    /// Free radius, m.
    r0 "UNLOADED_RADIUS" Refused;
    /// Nominal load, N.
    fz0 "FNOMIN" Refused;
    /// Vertical stiffness, N/m.
    vertical_stiffness "VERTICAL_STIFFNESS" Refused;
    /// Vertical damping, N s/m.
    vertical_damping "VERTICAL_DAMPING" Is(0.0);
    breff "BREFF" Is(0.0);
    dreff "DREFF" Is(0.0);
    freff "FREFF" Is(0.0);
    /// Speed of the measurement, m/s.
    longvl "LONGVL" Is(16.7);
    fzmin "FZMIN" Is(0.0);
    fzmax "FZMAX" Is(f64::INFINITY);
    cammin "CAMMIN" Is(-0.35);
    cammax "CAMMAX" Is(0.35);
    lfzo "LFZO" Is(1.0);
    lcx "LCX" Is(1.0);
    lmux "LMUX" Is(1.0);
    lex "LEX" Is(1.0);
    lkx "LKX" Is(1.0);
    lhx "LHX" Is(1.0);
    lvx "LVX" Is(1.0);
    lgax "LGAX" Is(1.0);
    lcy "LCY" Is(1.0);
    lmuy "LMUY" Is(1.0);
    ley "LEY" Is(1.0);
    lky "LKY" Is(1.0);
    lhy "LHY" Is(1.0);
    lvy "LVY" Is(1.0);
    lgay "LGAY" Is(1.0);
    ltr "LTR" Is(1.0);
    lres "LRES" Is(1.0);
    lgaz "LGAZ" Is(1.0);
    lxal "LXAL" Is(1.0);
    lyka "LYKA" Is(1.0);
    lvyka "LVYKA" Is(1.0);
    ls "LS" Is(1.0);
    lsgkp "LSGKP" Is(1.0);
    lsgal "LSGAL" Is(1.0);
    lmx "LMX" Is(1.0);
    lvmx "LVMX" Is(1.0);
    lmy "LMY" Is(1.0);
    pcx1 "PCX1" Refused;
    pdx1 "PDX1" Refused;
    pdx2 "PDX2" Is(0.0);
    pdx3 "PDX3" Is(0.0);
    pex1 "PEX1" Is(0.0);
    pex2 "PEX2" Is(0.0);
    pex3 "PEX3" Is(0.0);
    pex4 "PEX4" Is(0.0);
    pkx1 "PKX1" Refused;
    pkx2 "PKX2" Is(0.0);
    pkx3 "PKX3" Is(0.0);
    phx1 "PHX1" Is(0.0);
    phx2 "PHX2" Is(0.0);
    pvx1 "PVX1" Is(0.0);
    pvx2 "PVX2" Is(0.0);
    rbx1 "RBX1" Is(0.0);
    rbx2 "RBX2" Is(0.0);
    rcx1 "RCX1" Is(0.0);
    rex1 "REX1" Is(0.0);
    rex2 "REX2" Is(0.0);
    rhx1 "RHX1" Is(0.0);
    ptx1 "PTX1" Is(0.0);
    ptx2 "PTX2" Is(0.0);
    ptx3 "PTX3" Is(0.0);
    qsx1 "QSX1" Is(0.0);
    qsx2 "QSX2" Is(0.0);
    qsx3 "QSX3" Is(0.0);
    pcy1 "PCY1" Refused;
    pdy1 "PDY1" Refused;
    pdy2 "PDY2" Is(0.0);
    pdy3 "PDY3" Is(0.0);
    pey1 "PEY1" Is(0.0);
    pey2 "PEY2" Is(0.0);
    pey3 "PEY3" Is(0.0);
    pey4 "PEY4" Is(0.0);
    pky1 "PKY1" Refused;
    pky2 "PKY2" Refused;
    pky3 "PKY3" Is(0.0);
    phy1 "PHY1" Is(0.0);
    phy2 "PHY2" Is(0.0);
    phy3 "PHY3" Is(0.0);
    pvy1 "PVY1" Is(0.0);
    pvy2 "PVY2" Is(0.0);
    pvy3 "PVY3" Is(0.0);
    pvy4 "PVY4" Is(0.0);
    rby1 "RBY1" Is(0.0);
    rby2 "RBY2" Is(0.0);
    rby3 "RBY3" Is(0.0);
    rcy1 "RCY1" Is(0.0);
    rey1 "REY1" Is(0.0);
    rey2 "REY2" Is(0.0);
    rhy1 "RHY1" Is(0.0);
    rhy2 "RHY2" Is(0.0);
    rvy1 "RVY1" Is(0.0);
    rvy2 "RVY2" Is(0.0);
    rvy3 "RVY3" Is(0.0);
    rvy4 "RVY4" Is(0.0);
    rvy5 "RVY5" Is(0.0);
    rvy6 "RVY6" Is(0.0);
    pty1 "PTY1" Is(0.0);
    pty2 "PTY2" Is(0.0);
    qsy1 "QSY1" Is(0.0);
    qsy2 "QSY2" Is(0.0);
    qsy3 "QSY3" Is(0.0);
    qsy4 "QSY4" Is(0.0);
    qbz1 "QBZ1" Is(0.0);
    qbz2 "QBZ2" Is(0.0);
    qbz3 "QBZ3" Is(0.0);
    qbz4 "QBZ4" Is(0.0);
    qbz5 "QBZ5" Is(0.0);
    qbz9 "QBZ9" Is(0.0);
    qbz10 "QBZ10" Is(0.0);
    qcz1 "QCZ1" Is(0.0);
    qdz1 "QDZ1" Is(0.0);
    qdz2 "QDZ2" Is(0.0);
    qdz3 "QDZ3" Is(0.0);
    qdz4 "QDZ4" Is(0.0);
    qdz6 "QDZ6" Is(0.0);
    qdz7 "QDZ7" Is(0.0);
    qdz8 "QDZ8" Is(0.0);
    qdz9 "QDZ9" Is(0.0);
    qez1 "QEZ1" Is(0.0);
    qez2 "QEZ2" Is(0.0);
    qez3 "QEZ3" Is(0.0);
    qez4 "QEZ4" Is(0.0);
    qez5 "QEZ5" Is(0.0);
    qhz1 "QHZ1" Is(0.0);
    qhz2 "QHZ2" Is(0.0);
    qhz3 "QHZ3" Is(0.0);
    qhz4 "QHZ4" Is(0.0);
    ssz1 "SSZ1" Is(0.0);
    ssz2 "SSZ2" Is(0.0);
    ssz3 "SSZ3" Is(0.0);
    ssz4 "SSZ4" Is(0.0);
    =>
    /// Early softening, 0 in the Magic Formula, 1 in a brush: in no file, for the differences of other formulas.
    #[serde(default)]
    softening
}

impl Coefficients {
    /// The tyre mounted on the other side. Coefficients of ply steer and conicity change their sign, so that
    ///
    /// ```text
    ///     Fx' = Fx,   Fy' = -Fy,   Mx' = -Mx,   Mz' = -Mz      at -alpha, -gamma
    /// ```
    #[must_use]
    pub(super) fn mirrored(mut self) -> Self {
        for odd in [
            &mut self.rhx1,
            &mut self.qsx1,
            &mut self.pey3,
            &mut self.phy1,
            &mut self.phy2,
            &mut self.pvy1,
            &mut self.pvy2,
            &mut self.rby3,
            &mut self.rvy1,
            &mut self.rvy2,
            &mut self.qbz4,
            &mut self.qdz3,
            &mut self.qdz6,
            &mut self.qdz7,
            &mut self.qez4,
            &mut self.qhz1,
            &mut self.qhz2,
            &mut self.ssz1,
        ] {
            *odd = -*odd;
        }
        self
    }
}
