use burn::tensor::Device;

/// Where [`train`](super::train) computes: the CPU, or with the crate's `gpu` feature the first
/// graphics device, where there is one.
#[must_use]
pub fn training_device() -> Device {
    #[cfg(feature = "gpu")]
    if let Some(device) = Device::enumerate(burn::tensor::DeviceType::Wgpu)
        .into_iter()
        .next()
    {
        return device;
    }
    Device::flex()
}
