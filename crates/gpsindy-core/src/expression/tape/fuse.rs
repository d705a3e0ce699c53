//! Fused steps: a product and the sum that alone reads it are one instruction.
//!
//! Most equations are sums of products, and to look an instruction up costs as much as to carry it out. Both roundings stay, so no bit changes.

use super::operation::Operation;
use super::{Instruction, Register, Step};
use std::collections::{HashMap, HashSet};

/// The same program with every product in the sum that alone reads it; `outputs` are read by the caller.
pub(super) fn fused(steps: Vec<Step>, outputs: &[Register]) -> Vec<Step> {
    let mut readers: HashMap<Register, usize> = HashMap::new();
    let mut reads = |register: Register| *readers.entry(register).or_default() += 1;
    outputs.iter().for_each(|&register| reads(register));
    for step in &steps {
        match step {
            // What an instruction reads twice it reads once.
            Step::Compute(Instruction { operands: [a, b, c], .. }, _) => {
                reads(*a);
                [*b].into_iter().filter(|b| b != a).for_each(&mut reads);
                [*c].into_iter().filter(|c| c != a && c != b).for_each(&mut reads);
            }
            Step::Simulate(call) => call.arguments.iter().for_each(|&register| reads(register)),
        }
    }
    let product = |step: &Step| match step {
        Step::Compute(Instruction { operation: Operation::Multiply, operands: [a, b, _] }, out) => {
            (readers.get(out) == Some(&1)).then_some((*out, [*a, *b]))
        }
        _ => None,
    };
    let products: HashMap<Register, [Register; 2]> = steps.iter().filter_map(product).collect();
    let mut inside = HashSet::new();
    let mut fuse = |step: Step| {
        let Step::Compute(Instruction { operation, operands: [a, b, _] }, out) = step else { return step };
        let (behind, before) = match operation {
            Operation::Add => (Operation::MultiplyAdd, Operation::MultiplyAdd),
            Operation::Subtract => (Operation::SubtractProduct, Operation::MultiplySubtract),
            _ => return step,
        };
        let found = [(b, a, behind), (a, b, before)].into_iter().find_map(|(of, other, operation)| {
            let [x, y] = products.get(&of).filter(|_| a != b)?;
            Some((of, Instruction { operation, operands: [*x, *y, other] }))
        });
        let Some((of, instruction)) = found else { return step };
        inside.insert(of);
        Step::Compute(instruction, out)
    };
    let fused: Vec<Step> = steps.into_iter().map(&mut fuse).collect();
    let is_read = |step: &Step| !matches!(step, Step::Compute(_, out) if inside.contains(out));
    fused.into_iter().filter(is_read).collect()
}
