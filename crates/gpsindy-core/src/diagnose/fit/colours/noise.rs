//! The noise models by which gains are taken, and what there is of each.

/// What the noise of the sensors is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Noise {
    /// White: what is left in all of its size.
    White,
    /// Coloured as the residuals of the fit are.
    Coloured,
    /// What a filter did not foresee, which only a simulator that steps has.
    Innovations,
}

impl Noise {
    /// All of them.
    pub(crate) const ALL: [Self; 3] = [Self::White, Self::Coloured, Self::Innovations];
}

/// One thing for each noise model that was looked at.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ByNoise<T>(Vec<(Noise, T)>);

impl<T> ByNoise<T> {
    /// That of one noise model, where it was looked at.
    pub(crate) fn of(&self, noise: Noise) -> Option<&T> {
        self.0.iter().find(|(own, _)| *own == noise).map(|(_, value)| value)
    }

    pub(crate) fn of_mut(&mut self, noise: Noise) -> Option<&mut T> {
        self.0.iter_mut().find(|(own, _)| *own == noise).map(|(_, value)| value)
    }

    /// Each noise model that was looked at, with what there is of it.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (Noise, &T)> {
        self.0.iter().map(|(noise, value)| (*noise, value))
    }

    /// Adds what there is of other noise models.
    pub(crate) fn extend(&mut self, more: Self) {
        self.0.extend(more.0);
    }
}

impl<T> FromIterator<(Noise, T)> for ByNoise<T> {
    fn from_iter<I: IntoIterator<Item = (Noise, T)>>(all: I) -> Self {
        Self(all.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_looked_at_is_not_there() {
        let mut gains: ByNoise<f64> = [(Noise::White, 1.0), (Noise::Coloured, 2.0)].into_iter().collect();
        assert_eq!((gains.of(Noise::Coloured), gains.of(Noise::Innovations)), (Some(&2.0), None));
        gains.extend([(Noise::Innovations, 3.0)].into_iter().collect());
        let all: Vec<f64> = Noise::ALL.iter().filter_map(|&noise| gains.of(noise).copied()).collect();
        assert_eq!(all, [1.0, 2.0, 3.0]);
    }
}
