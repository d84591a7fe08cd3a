//! What the FMUs of all plants say alike to their vehicles.

/// Passes the calls of [`PlantUnit`](super::PlantUnit) that any vehicle answers on to it.
macro_rules! delegate {
    ($parameters:ty, $effects:ty, $output:ty) => {
        type Parameters = $parameters;
        type Effects = $effects;
        type Output = $output;

        fn effect<'a>(effects: &'a mut $effects, id: &str) -> Option<&'a mut f64> {
            effects.get_mut(id)
        }

        fn make(
            parameters: &$parameters,
            effects: &$effects,
            road: Option<std::sync::Arc<crate::path::Path>>,
        ) -> Result<Self, String> {
            Self::new(parameters, effects, road).map_err(|error| error.to_string())
        }

        fn place(&mut self, x: f64, y: f64, yaw: f64, vx: f64) {
            self.place(x, y, yaw, vx);
        }

        fn step(
            &mut self,
            input: &crate::vehicle::VehicleInput,
            step: f64,
        ) -> Result<(), crate::vehicle::PlantStepError> {
            self.step(input, step)
        }

        fn step_to_status(
            &mut self,
            input: &crate::vehicle::VehicleInput,
            step: f64,
        ) -> Result<f64, crate::vehicle::PlantStepError> {
            let before = self.output().status;
            self.step_until(input, step, |output| output.status != before)
        }

        fn output(&self) -> &$output {
            self.output()
        }

        fn wheels(output: &$output) -> &[crate::vehicle::WheelOutput] {
            &output.wheels
        }

        fn status(output: &$output) -> i32 {
            output.status as i32
        }

        fn save(&self, bytes: &mut Vec<u8>) {
            self.save(bytes);
        }

        fn restore(&mut self, bytes: &[u8]) -> Result<(), crate::vehicle::RestoreError> {
            self.restore(bytes)
        }

        fn check_state(bytes: &[u8]) -> Result<(), crate::vehicle::RestoreError> {
            Self::check_state(bytes)
        }
    };
}
pub(in crate::fmu) use delegate;
