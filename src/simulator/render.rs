//! Pictures of a scene of boxes, cylinders and spheres, computed on the CPU.
//!
//! Visibility is rasterised with 2x2 samples a pixel; every surface that shows in a pixel is then
//! shaded once, with one sun, sky and floor light that knows about near occluders, and a small
//! light at the camera. Nothing here draws lots and nothing runs in parallel, so the same scene
//! gives the same bytes.

mod grid;
mod occlusion;
mod raster;
mod shade;
mod solid;
mod sun;
mod texture;

#[cfg(test)]
mod tests;

use nalgebra::Isometry3;

use crate::trajectory::Image;

use raster::Raster;
use shade::Shader;
use solid::{Eye, Solid};

/// The form of a visual, centred at the origin of its own frame; lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A cuboid.
    Box {
        /// Half of its size along x, y and z.
        half_extents: [f32; 3],
    },
    /// A closed cylinder along the local z axis.
    Cylinder {
        /// Radius.
        radius: f32,
        /// Half of its length.
        half_height: f32,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f32,
    },
}

/// What a surface looks like close up. All textures are procedural and tile without seams.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Texture {
    /// One colour.
    Plain,
    /// Wood whose grain runs along the longer side of a face.
    Wood,
    /// Floor boards along local x. Lets the sun through, see [`Texture::Plaster`].
    Floor,
    /// Woven cloth.
    Fabric,
    /// Squares, tinted and off-white in turn.
    Checks,
    /// Stripes, tinted and off-white in turn.
    Stripes,
    /// A printed label: a tinted ground, a pale band and a mark. Fitted to the face.
    Label,
    /// Painted wall. Lets the sun through, so that a closed room is lit.
    Plaster,
    /// A painted landscape. Fitted to the face. Lets the sun through as the wall behind it does.
    Picture,
    /// Knitted wool with ribs.
    Knit,
}

/// How a visual's surface reflects light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Pattern of the surface.
    pub texture: Texture,
    /// Linear RGB, each 0..=1, that colours the pattern.
    pub tint: [f32; 3],
    /// Repeats of the pattern per metre; per face for [`Texture::Label`] and [`Texture::Picture`].
    pub scale: f32,
    /// Strength of the sun's highlight: 0 is matt, 1 is polished.
    pub specular: f32,
    /// Light that the surface gives off by itself, as a multiple of its colour.
    pub emission: f32,
}

/// One primitive in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visual {
    /// Its form.
    pub shape: Shape,
    /// Its pose in the world.
    pub world_from_shape: Isometry3<f32>,
    /// Its surface.
    pub material: Material,
}

/// The light in a scene; strengths are multiples of a bright room's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Unit vector towards the sun.
    pub sun_direction: [f32; 3],
    /// Strength of the sun, 1 is nominal.
    pub sun: f32,
    /// Strength of the light from all around, 1 is nominal.
    pub ambient: f32,
    /// Strength of the light at the camera, 1 is nominal.
    pub headlight: f32,
}

impl Default for Lighting {
    /// A clear forenoon.
    fn default() -> Self {
        Self {
            sun_direction: [-0.224_771, -0.561_927, 0.796_063],
            sun: 1.0,
            ambient: 1.0,
            headlight: 1.0,
        }
    }
}

/// Everything that can be seen, and the light that it is seen in.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The primitives, in any order; where two surfaces coincide the earlier one is seen.
    pub visuals: Vec<Visual>,
    /// The light.
    pub lighting: Lighting,
}

/// A pinhole camera. It looks along +x of its frame, with y to the left and z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pose of the camera in the world.
    pub world_from_camera: Isometry3<f32>,
    /// Angle between the upper and the lower edge of the picture, within 0..pi.
    pub vertical_fov_rad: f32,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
}

/// Draws scenes, and keeps its buffers from one picture to the next.
#[derive(Debug, Default)]
pub struct Renderer {
    raster: Raster,
    sun: sun::SunGrid,
    occlusion: occlusion::OcclusionGrid,
    solids: Vec<Solid>,
}

impl Renderer {
    /// A renderer with empty buffers; they grow with the first picture.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Draws what `camera` sees of `scene`, `camera.height` x `camera.width` pixels.
    ///
    /// Surfaces nearer than 1 cm and the insides of visuals are not drawn. The picture depends on
    /// the arguments only, not on earlier pictures.
    ///
    /// # Panics
    /// When the picture has so many pixels that they do not fit into memory.
    pub fn render(&mut self, scene: &Scene, camera: &Camera) -> Image {
        let [image] = self.render_each(scene, [camera]);
        image
    }

    /// Draws what each of several cameras sees of `scene`. The pictures are those that
    /// [`render`](Self::render) draws; what the light needs is looked up once for all of them.
    ///
    /// # Panics
    /// As [`render`](Self::render).
    pub fn render_each<const CAMERAS: usize>(
        &mut self,
        scene: &Scene,
        cameras: [&Camera; CAMERAS],
    ) -> [Image; CAMERAS] {
        let mut lit = false;
        cameras.map(|camera| {
            let eye = Eye::new(camera);
            let solid = |visual| Solid::new(visual, &eye, &scene.lighting);
            self.solids.clear();
            self.solids.extend(scene.visuals.iter().map(solid));
            if !lit {
                self.sun.rebuild(&self.solids, &scene.lighting);
                self.occlusion.rebuild(&self.solids);
                lit = true;
            }
            self.raster.draw(&self.solids, &eye);
            let shader = Shader::new(
                &self.solids,
                &self.sun,
                &self.occlusion,
                &scene.lighting,
                &eye,
            );
            let rgb = shader.develop(&self.raster);
            Image::new(camera.height, camera.width, rgb)
                .expect("three bytes were made for each pixel")
        })
    }
}
