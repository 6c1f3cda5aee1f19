use burn::tensor::Device;

/// Where [`train`](super::train) computes: the CPU, or with the crate's `gpu` feature the first Vulkan
/// device.
#[must_use]
pub fn training_device() -> Device {
    #[cfg(feature = "gpu")]
    {
        Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)
    }
    #[cfg(not(feature = "gpu"))]
    {
        Device::flex()
    }
}
