//! Shaders from modules: WESL (WGSL with imports and conditions) in, one WGSL text with numbered bindings out.
//!
//! ```text
//! modules of passes, flags, constants from Rust --wesl--> what the entry points use --number--> WGSL, names of bindings
//! ```
//!
//! A shader imports with `import package::view::View;`, leaves parts out with `@if(flag)`, and reads numbers
//! defined in Rust from `package::constants`. Its bindings have a group but no number: this module numbers them in the
//! order of their declaration, and passes bind resources by name.

use std::collections::HashMap;

use wesl::syntax::{
    AddressSpace, Attribute, DeclarationKind, Expression, GlobalDeclaration, LiteralExpression,
    TranslationUnit,
};
use wesl::{CompileOptions, Feature, Features, NoMangler, VirtualResolver};

/// A file of shader code and the path that others import it by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Module {
    pub(crate) path: &'static str,
    pub(crate) source: &'static str,
}

/// A module whose path is below `package::`.
macro_rules! module {
    ($path:literal, $file:literal) => {
        $crate::device::wgsl::Module { path: concat!("package::", $path), source: include_str!($file) }
    };
}
pub(crate) use module;

/// Modules that every shader may import.
const SHARED: [Module; 8] = [
    module!("authored", "../shared/authored.wesl"),
    module!("blocks", "../shared/blocks.wesl"),
    module!("math", "../shared/math.wesl"),
    module!("light", "../shared/light.wesl"),
    module!("shadow_map", "../shared/shadow_map.wesl"),
    module!("slab", "../shared/slab.wesl"),
    module!("surface", "../shared/surface.wesl"),
    module!("view", "../shared/view.wesl"),
];

/// A number that Rust passes to a shader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Constant {
    Bool(bool),
    U32(u32),
    F32(f32),
}

impl From<bool> for Constant {
    fn from(value: bool) -> Self {
        Self::Bool(value)
    }
}

impl From<u32> for Constant {
    fn from(value: u32) -> Self {
        Self::U32(value)
    }
}

impl From<f32> for Constant {
    fn from(value: f32) -> Self {
        Self::F32(value)
    }
}

/// Parts of a shader.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    root: Module,
    modules: Vec<Module>,
    flags: Vec<&'static str>,
    constants: Vec<(&'static str, Constant)>,
}

/// A binding of a linked shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Binding {
    pub(crate) name: String,
    pub(crate) group: u32,
    pub(crate) binding: u32,
}

/// A linked shader, ready for the device.
#[derive(Clone, Debug)]
pub(crate) struct Linked {
    pub(crate) wgsl: String,
    pub(crate) bindings: Vec<Binding>,
}

/// The text of a module.
#[cfg(not(feature = "faults"))]
fn source(module: &Module) -> &'static str {
    module.source
}

/// The text of a module, wrong if a test asked for it.
#[cfg(feature = "faults")]
fn source(module: &Module) -> String {
    faults::changed(module)
}

/// Wrong shaders on purpose: what measures errors has to notice them. Only with the feature `faults`, which tests use.
#[cfg(feature = "faults")]
pub mod faults {
    use std::sync::{Mutex, PoisonError};

    /// A change of a shader module.
    #[derive(Clone, Copy, Debug)]
    pub struct Fault {
        /// Name of the module, without `package::`.
        pub module: &'static str,
        /// Text that it has once.
        pub right: &'static str,
        /// Text in its place.
        pub wrong: &'static str,
    }

    /// The fault of this process, and how often it was put in.
    static FAULT: Mutex<(Option<Fault>, u32)> = Mutex::new((None, 0));

    /// Links all shaders with a fault from now on, or with none; returns how many modules had the last one.
    pub fn set(fault: Option<Fault>) -> u32 {
        let mut set = FAULT.lock().unwrap_or_else(PoisonError::into_inner);
        let count = set.1;
        *set = (fault, 0);
        count
    }

    pub(super) fn changed(module: &super::Module) -> String {
        let mut set = FAULT.lock().unwrap_or_else(PoisonError::into_inner);
        match set.0 {
            Some(fault) if module.path.strip_prefix("package::") == Some(fault.module) => {
                assert_eq!(
                    module.source.matches(fault.right).count(),
                    1,
                    "{} has {:?} once",
                    fault.module,
                    fault.right
                );
                set.1 += 1;
                module.source.replacen(fault.right, fault.wrong, 1)
            }
            _ => module.source.to_owned(),
        }
    }
}

impl Program {
    /// A program whose entry points are in `root`.
    pub(crate) fn new(root: Module) -> Self {
        Self { root, modules: vec![root], flags: Vec::new(), constants: Vec::new() }
    }

    /// Adds modules that it imports.
    pub(crate) fn with(mut self, modules: &[Module]) -> Self {
        self.modules.extend_from_slice(modules);
        self
    }

    /// Keeps the code behind `@if(flag)` if `on`.
    pub(crate) fn flag(mut self, flag: &'static str, on: bool) -> Self {
        if on {
            self.flags.push(flag);
        }
        self
    }

    /// A constant of the module `package::constants`.
    pub(crate) fn constant(mut self, name: &'static str, value: impl Into<Constant>) -> Self {
        self.constants.push((name, value.into()));
        self
    }

    /// Links the entry points `entries` and the code that they use. `stored_uniforms` turns uniform buffers into
    /// storage buffers (see [`crate::device::Gpu`]).
    ///
    /// # Panics
    /// The shader does not parse or an import is missing. Tests link every shader, so this cannot reach a user.
    pub(crate) fn link(&self, entries: &[&str], stored_uniforms: bool) -> Linked {
        let mut resolver = VirtualResolver::new();
        let path = |text: &str| text.parse().unwrap_or_else(|e| panic!("module path {text}: {e}"));
        for module in SHARED.iter().chain(&self.modules) {
            resolver.add_module(path(module.path), source(module).into());
        }
        let constants: String =
            self.constants.iter().map(|(name, value)| declaration(name, *value)).collect();
        resolver.add_module(path("package::constants"), constants.into());
        let flags: HashMap<String, Feature> =
            self.flags.iter().map(|flag| ((*flag).to_owned(), Feature::Enable)).collect();
        let options = CompileOptions {
            keep: Some(entries.iter().map(|e| (*e).to_owned()).collect()),
            features: Features { default: Feature::Disable, flags },
            ..CompileOptions::default()
        };
        let linked = wesl::compile(&path(self.root.path), &resolver, &NoMangler, &options);
        let mut unit = linked.unwrap_or_else(|e| panic!("{}: {e}", self.root.path)).syntax;
        let bindings = number_bindings(&mut unit, stored_uniforms);
        Linked { wgsl: unit.to_string(), bindings }
    }
}

fn declaration(name: &str, value: Constant) -> String {
    match value {
        Constant::Bool(b) => format!("const {name} = {b};\n"),
        Constant::U32(n) => format!("const {name} = {n}u;\n"),
        Constant::F32(x) => format!("const {name} = {x:?}f;\n"),
    }
}

/// Gives each variable with a group its number.
fn number_bindings(unit: &mut TranslationUnit, stored_uniforms: bool) -> Vec<Binding> {
    let mut next: HashMap<u32, u32> = HashMap::new();
    let mut bindings = Vec::new();
    for declaration in &mut unit.global_declarations {
        let GlobalDeclaration::Declaration(variable) = declaration.node_mut() else { continue };
        let group = variable.attributes.iter().find_map(|a| match a.node() {
            Attribute::Group(number) => literal(number.node()),
            _ => None,
        });
        let Some(group) = group else { continue };
        let number = next.entry(group).or_default();
        let binding = Attribute::Binding(
            Expression::Literal(LiteralExpression::AbstractInt(i64::from(*number))).into(),
        );
        variable.attributes.push(binding.into());
        if let DeclarationKind::Var(Some((space @ AddressSpace::Uniform, _))) = &mut variable.kind
            && stored_uniforms
        {
            *space = AddressSpace::Storage;
        }
        bindings.push(Binding { name: variable.ident.name().clone(), group, binding: *number });
        *number += 1;
    }
    bindings
}

fn literal(expression: &Expression) -> Option<u32> {
    match expression {
        Expression::Literal(LiteralExpression::AbstractInt(n)) => u32::try_from(*n).ok(),
        Expression::Literal(LiteralExpression::U32(n)) => Some(*n),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOT: Module = Module {
        path: "package::test",
        source: "import package::test_parts::scaled; import package::constants::FACTOR;
            struct Params { size: u32 }
            @group(0) var<uniform> params: Params;
            @if(more) @group(0) var<storage, read> before: array<f32>;
            @group(0) var<storage, read_write> after: array<f32>;
            @group(1) var unused: texture_2d<f32>;
            @compute @workgroup_size(8) fn main() {
                after[0] = scaled(f32(params.size)) * FACTOR;
                @if(more) after[0] = before[0];
            }
            @compute @workgroup_size(8) fn other() { after[0] = textureLoad(unused, vec2u(0u), 0).x; }",
    };
    const PARTS: Module = Module {
        path: "package::test_parts",
        source: "fn scaled(x: f32) -> f32 { return 2.0 * x; } fn idle() {}",
    };

    fn names(linked: &Linked) -> Vec<(&str, u32, u32)> {
        linked.bindings.iter().map(|b| (b.name.as_str(), b.group, b.binding)).collect()
    }

    #[test]
    fn what_an_entry_uses_is_linked_and_numbered() {
        let program = Program::new(ROOT).with(&[PARTS]).constant("FACTOR", 0.25);
        let plain = program.link(&["main"], false);
        assert_eq!(names(&plain), [("params", 0, 0), ("after", 0, 1)]);
        assert!(!plain.wgsl.contains("idle") && plain.wgsl.contains("FACTOR = 0.25"), "{}", plain.wgsl);
        let more = program.clone().flag("more", true).link(&["main"], true);
        assert_eq!(names(&more), [("params", 0, 0), ("before", 0, 1), ("after", 0, 2)]);
        assert!(
            more.wgsl.contains("var<storage> params") || more.wgsl.contains("var<storage, read> params"),
            "{}",
            more.wgsl
        );
        assert_eq!(names(&program.link(&["other"], false)), [("after", 0, 0), ("unused", 1, 0)]);
        crate::testing::validated_workgroups(&more.wgsl);
    }
}
