//! Opens a device and waits for it, for programs outside of a browser. Nothing else in this crate waits.

use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use super::gpu::{AdapterDescription, Gpu};
use crate::error::RenderError;

/// Opens the best adapter, or the one whose index or part of whose name (any letter case) is `wanted`.
///
/// # Errors
/// No adapter exists, none has that name, or the driver refuses.
pub fn open(wanted: Option<&str>) -> Result<Gpu, RenderError> {
    pollster::block_on(Gpu::new(wanted))
}

/// All adapters of this machine, best first.
pub fn adapters() -> Vec<AdapterDescription> {
    pollster::block_on(super::gpu::list_adapters())
}

/// Waits for a result that needs the device to finish its work, but only for the submission that produces the result.
pub fn wait<T>(gpu: &Gpu, future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(result) = future.as_mut().poll(&mut context) {
            return result;
        }
        let wait = wgpu::PollType::Wait { submission_index: gpu.take_wanted(), timeout: None };
        if gpu.device.poll(wait).is_err() {
            // A lost device completes pending requests with errors later.
            std::thread::yield_now();
        }
    }
}
