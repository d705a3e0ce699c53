//! Steps of a fixed length: Euler's method and the classical one of Runge and Kutta.

use super::super::explicit::{euler, runge_kutta_4};
use super::super::holding::{Change, first_change};
use super::super::rates::Rates;
use super::{Accept, Method, Walker};
use crate::error::Result;

impl Walker<'_> {
    /// From `a` to `b`, s, in `substeps` equal steps.
    pub(super) fn fixed(
        &mut self,
        rates: &mut Rates<'_>,
        x: &mut [f64],
        (a, b): (f64, f64),
        substeps: usize,
        accept: Accept<'_>,
    ) -> Result<()> {
        let h = (b - a) / substeps as f64;
        let mut end = x.to_vec();
        let mut end_slope = x.to_vec();
        for i in 0..substeps {
            let t = a + h * i as f64;
            rates.rate(t, x, &mut self.slope);
            self.one_fixed(rates, (t, h), x, (&mut end, &mut end_slope))?;
            accept(&self.dense);
            x.copy_from_slice(&end);
        }
        Ok(())
    }

    /// One step of fixed length `h` from `x` at `t`, where the slope is there: the states at its end and their rates.
    fn one_fixed(
        &mut self,
        rates: &mut Rates<'_>,
        (t, h): (f64, f64),
        x: &[f64],
        (end, end_slope): (&mut [f64], &mut [f64]),
    ) -> Result<()> {
        match self.settings.method {
            Method::Euler { .. } => euler(h, x, &self.slope, end),
            _ => runge_kutta_4(rates, t, h, x, &self.slope, end),
        }
        self.check_bound(rates, t + h, end)?;
        rates.rate(t + h, end, end_slope);
        self.dense.set_cubic(t, h, x, end, &self.slope, end_slope);
        self.march.n_steps += 1;
        Ok(())
    }

    /// As [`Walker::fixed`], with steps that end where a mode changes.
    pub(super) fn fixed_holding(
        &mut self,
        rates: &mut Rates<'_>,
        x: &mut [f64],
        (a, b): (f64, f64),
        substeps: usize,
        accept: Accept<'_>,
    ) -> Result<()> {
        let h = (b - a) / substeps as f64;
        let mut end = x.to_vec();
        let mut end_slope = x.to_vec();
        for i in 0..substeps {
            let mut t = a + h * i as f64;
            let stop = a + h * (i + 1) as f64;
            let mut change = None;
            rates.begin(t, x, &mut self.slope);
            let mut length = stop - t;
            loop {
                self.one_fixed(rates, (t, length), x, (&mut end, &mut end_slope))?;
                if change.is_none() && self.march.n_steps < self.settings.max_steps {
                    change = first_change(rates, &self.dense, x, &self.slope);
                    if let Some(Change { at, .. }) = change {
                        // Once more, up to the change.
                        length = at - t;
                        continue;
                    }
                }
                accept(&self.dense);
                x.copy_from_slice(&end);
                t += length;
                let Some(found) = change.take() else { break };
                let taken = length;
                length = stop - t;
                self.change(rates, t, x, found, taken <= 0.0);
            }
            rates.open();
        }
        Ok(())
    }
}
