//! Finds the places in a file that a mutant may change, outer places first.

use std::ops::Range;

use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{
    Arm, BinOp, Block, Expr, ExprBinary, ExprRepeat, ExprUnary, ImplItemConst, ImplItemFn, ItemConst, ItemFn,
    ItemStatic, TraitItemFn, TypeArray,
};

use crate::{Position, start};

/// A place that a mutant may change. Ranges are in bytes.
pub(crate) struct Place {
    pub(crate) range: Range<usize>,
    /// Line and column at which cargo-mutants lists the place.
    pub(crate) named_at: Position,
    pub(crate) kind: Kind,
}

pub(crate) enum Kind {
    Binary {
        left: Range<usize>,
        operator: Range<usize>,
        right: Range<usize>,
    },
    Unary {
        operator: Range<usize>,
        operand: Range<usize>,
    },
    Guard,
    /// A function's statements.
    Body,
    /// A match arm up to its arrow.
    Arm {
        guard: Option<Range<usize>>,
    },
}

impl Kind {
    /// Name of this kind of place in cargo-mutants' list.
    pub(crate) fn genre(&self) -> &'static str {
        match self {
            Self::Binary { .. } => "BinaryOperator",
            Self::Unary { .. } => "UnaryOperator",
            Self::Guard => "MatchArmGuard",
            Self::Body => "FnValue",
            Self::Arm { .. } => "MatchArm",
        }
    }
}

pub(crate) fn all(file: &syn::File) -> Vec<Place> {
    let mut found = Found(Vec::new());
    found.visit_file(file);
    found.0.sort_by_key(|place| (place.range.start, std::cmp::Reverse(place.range.end)));
    found.0
}

struct Found(Vec<Place>);

impl Found {
    fn body(&mut self, block: &Block) {
        if let (Some(first), Some(last)) = (block.stmts.first(), block.stmts.last()) {
            let range = range(first).start..range(last).end;
            self.0.push(Place { range, named_at: start(first), kind: Kind::Body });
        }
    }
}

/// Compile-time code can't read a switch, so the visitor doesn't descend into it.
impl<'a> Visit<'a> for Found {
    fn visit_item_const(&mut self, _: &'a ItemConst) {}
    fn visit_item_static(&mut self, _: &'a ItemStatic) {}
    fn visit_impl_item_const(&mut self, _: &'a ImplItemConst) {}
    fn visit_type_array(&mut self, _: &'a TypeArray) {}

    fn visit_expr_repeat(&mut self, repeat: &'a ExprRepeat) {
        self.visit_expr(&repeat.expr);
    }

    fn visit_item_fn(&mut self, function: &'a ItemFn) {
        if function.sig.constness.is_none() {
            self.body(&function.block);
            visit::visit_item_fn(self, function);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'a ImplItemFn) {
        if function.sig.constness.is_none() {
            self.body(&function.block);
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_trait_item_fn(&mut self, function: &'a TraitItemFn) {
        if let Some(block) = &function.default {
            self.body(block);
        }
        visit::visit_trait_item_fn(self, function);
    }

    fn visit_expr_binary(&mut self, binary: &'a ExprBinary) {
        if !binds(&binary.left) && !binds(&binary.right) {
            let kind = Kind::Binary {
                left: range(&binary.left),
                operator: range(&binary.op),
                right: range(&binary.right),
            };
            self.0.push(Place { range: range(binary), named_at: start(&binary.op), kind });
        }
        visit::visit_expr_binary(self, binary);
    }

    fn visit_expr_unary(&mut self, unary: &'a ExprUnary) {
        let kind = Kind::Unary { operator: range(&unary.op), operand: range(&unary.expr) };
        self.0.push(Place { range: range(unary), named_at: start(&unary.op), kind });
        visit::visit_expr_unary(self, unary);
    }

    fn visit_arm(&mut self, arm: &'a Arm) {
        let guard = arm.guard.as_ref().map(|(_, guard)| range(guard));
        let end = range(&arm.fat_arrow_token).start;
        let whole = range(&arm.pat).start..end;
        self.0.push(Place { range: whole, named_at: start(arm), kind: Kind::Arm { guard: guard.clone() } });
        if let (Some((_, expression)), Some(range)) = (&arm.guard, guard) {
            self.0.push(Place { range, named_at: start(expression), kind: Kind::Guard });
        }
        visit::visit_arm(self, arm);
    }
}

/// Returns whether a condition binds a name, as `if let` does. No operator other than `&&` can combine such a
/// condition with another one.
fn binds(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(ExprBinary { left, op: BinOp::And(_), right, .. }) => binds(left) || binds(right),
        _ => false,
    }
}

fn range(of: &impl Spanned) -> Range<usize> {
    of.span().byte_range()
}
