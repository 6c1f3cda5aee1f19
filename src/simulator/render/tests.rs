use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::{Camera, Lighting, Material, Renderer, Scene, Shape, Texture, Visual};
use crate::trajectory::Image;

const RED: [f32; 3] = [0.6, 0.02, 0.02];
const BLUE: [f32; 3] = [0.02, 0.02, 0.6];

fn visual(shape: Shape, at: [f32; 3], tint: [f32; 3]) -> Visual {
    Visual {
        shape,
        world_from_shape: Isometry3::translation(at[0], at[1], at[2]),
        material: Material {
            texture: Texture::Plain,
            tint,
            scale: 1.0,
            specular: 0.0,
            emission: 0.0,
        },
    }
}

fn cuboid(half_extents: [f32; 3], at: [f32; 3], tint: [f32; 3]) -> Visual {
    visual(Shape::Box { half_extents }, at, tint)
}

/// A camera at the origin that looks along +x; at 1 m distance the picture is 2 m high.
fn camera(height: u32, width: u32) -> Camera {
    Camera {
        world_from_camera: Isometry3::identity(),
        vertical_fov_rad: std::f32::consts::FRAC_PI_2,
        height,
        width,
    }
}

fn picture(visuals: Vec<Visual>, camera: &Camera) -> Image {
    let scene = Scene {
        visuals,
        lighting: Lighting::default(),
    };
    Renderer::new().render(&scene, camera)
}

fn pixel(image: &Image, row: u32, column: u32) -> [u8; 3] {
    let start = (row * image.width() + column) as usize * 3;
    std::array::from_fn(|channel| image.rgb()[start + channel])
}

fn is_red(pixel: [u8; 3]) -> bool {
    pixel[0] / 2 > pixel[2]
}

fn is_blue(pixel: [u8; 3]) -> bool {
    pixel[2] / 2 > pixel[0]
}

fn brightness(pixel: [u8; 3]) -> u32 {
    pixel.into_iter().map(u32::from).sum()
}

/// Rows and columns, as (first, past the last), in which red shows.
fn red_bounds(image: &Image) -> [(u32, u32); 2] {
    let mut bounds = [(u32::MAX, 0); 2];
    for row in 0..image.height() {
        for column in 0..image.width() {
            if is_red(pixel(image, row, column)) {
                for (bound, at) in bounds.iter_mut().zip([row, column]) {
                    *bound = (bound.0.min(at), bound.1.max(at + 1));
                }
            }
        }
    }
    bounds
}

#[test]
fn a_box_covers_the_pixels_that_geometry_says() {
    // Its front is 1 m away and reaches from -0.5 to 0.5 m left and -0.25 to 0.25 m up.
    let image = picture(
        vec![cuboid([0.5, 0.5, 0.25], [1.5, 0.0, 0.0], RED)],
        &camera(80, 160),
    );
    assert_eq!(red_bounds(&image), [(30, 50), (60, 100)]);
    let count = (0..80 * 160).filter(|at| is_red(pixel(&image, at / 160, at % 160)));
    assert_eq!(count.count(), 20 * 40, "the face is a full rectangle");
}

#[test]
fn a_floor_that_starts_behind_the_camera_fills_the_lower_half() {
    let image = picture(
        vec![cuboid([4.0, 9.0, 0.1], [0.0, 0.0, -0.6], RED)],
        &camera(80, 160),
    );
    // The floor lies 0.5 m below; its far edge at 4 m is 0.125 below the horizon: 5 of 40 rows.
    assert_eq!(red_bounds(&image), [(45, 80), (0, 160)]);
    assert!((45..80).all(|row| (0..160).all(|column| is_red(pixel(&image, row, column)))));
}

#[test]
fn a_wall_that_runs_past_the_camera_reaches_the_edge_of_the_picture() {
    // A wall 0.5 m to the left, from 3 m behind to 1 m ahead of the camera.
    let image = picture(
        vec![cuboid([2.0, 0.1, 0.3], [-1.0, 0.6, 0.0], RED)],
        &camera(80, 160),
    );
    let [rows, columns] = red_bounds(&image);
    assert_eq!(columns, (0, 60), "it ends 0.5 m left at 1 m");
    // The left edge of the picture has slope 2: the wall is met at 0.25 m, where 0.3 m is more
    // than half of the picture.
    assert_eq!(rows, (0, 80));
}

#[test]
fn a_box_around_the_camera_is_not_seen() {
    let inside = picture(
        vec![cuboid([1.0, 1.0, 1.0], [0.0, 0.0, 0.0], RED)],
        &camera(20, 40),
    );
    assert_eq!(inside, picture(Vec::new(), &camera(20, 40)));
}

#[test]
fn the_nearer_hides_the_farther_whatever_the_order() {
    let near = visual(Shape::Sphere { radius: 0.2 }, [1.0, 0.0, 0.0], RED);
    let far = cuboid([0.1, 1.0, 1.0], [2.0, 0.0, 0.0], BLUE);
    for visuals in [vec![near, far], vec![far, near]] {
        let image = picture(visuals, &camera(80, 160));
        assert!(is_red(pixel(&image, 40, 80)));
        assert!(is_blue(pixel(&image, 40, 100)));
    }
}

#[test]
fn left_of_the_camera_is_left_in_the_picture_and_up_is_up() {
    let ball = Shape::Sphere { radius: 0.1 };
    let image = picture(
        vec![
            visual(ball, [1.0, 0.5, 0.25], RED),
            visual(ball, [1.0, -0.5, -0.25], BLUE),
        ],
        &camera(80, 160),
    );
    assert!(is_red(pixel(&image, 30, 60)));
    assert!(is_blue(pixel(&image, 50, 100)));
}

#[test]
fn a_turned_camera_sees_what_lies_in_its_direction() {
    let mut camera = camera(80, 160);
    camera.world_from_camera = Isometry3::from_parts(
        Vector3::new(0.0, 1.0, 0.0).into(),
        UnitQuaternion::from_euler_angles(0.0, 0.0, std::f32::consts::FRAC_PI_2),
    );
    let ball = Shape::Sphere { radius: 0.1 };
    // The camera stands at y = 1 and looks along +y; world +x is to its right.
    let image = picture(vec![visual(ball, [0.5, 2.0, 0.0], RED)], &camera);
    assert!(is_red(pixel(&image, 40, 100)));
    assert!(!is_red(pixel(&image, 40, 60)));
}

#[test]
fn the_silhouette_of_a_sphere_is_where_geometry_says() {
    // A sphere of radius r at distance d is seen under asin(r / d): the tangent is r/sqrt(d2-r2).
    let (radius, distance) = (0.6_f32, 1.0_f32);
    let tangent = radius / (distance * distance - radius * radius).sqrt();
    let image = picture(
        vec![visual(Shape::Sphere { radius }, [distance, 0.0, 0.0], RED)],
        &camera(200, 200),
    );
    let reach = (tangent * 100.0).round() as u32;
    assert_eq!(
        red_bounds(&image),
        [(100 - reach, 100 + reach), (100 - reach, 100 + reach)]
    );
    let shown = (0..200 * 200).filter(|at| is_red(pixel(&image, at / 200, at % 200)));
    let expected = std::f32::consts::PI * (tangent * 100.0).powi(2);
    assert!((shown.count() as f32 / expected - 1.0).abs() < 0.01);
}

#[test]
fn a_lying_cylinder_shows_its_length_and_its_width() {
    let mut cylinder = visual(
        Shape::Cylinder {
            radius: 0.1,
            half_height: 0.5,
        },
        [1.1, 0.0, 0.0],
        RED,
    );
    // Its axis along y, so that it lies across the picture.
    cylinder.world_from_shape.rotation =
        UnitQuaternion::from_euler_angles(std::f32::consts::FRAC_PI_2, 0.0, 0.0);
    let image = picture(vec![cylinder], &camera(200, 200));
    let [rows, columns] = red_bounds(&image);
    let tangent = 0.1 / (1.1_f32 * 1.1 - 0.01).sqrt();
    assert_eq!(rows.1 - rows.0, 2 * (tangent * 100.0).round() as u32);
    // Its nearest line is 1 m away and 1 m long.
    assert_eq!(columns, (50, 150));
}

#[test]
fn a_shadow_darkens_and_only_where_it_falls() {
    let mut camera = camera(80, 80);
    // Straight down from 2 m, with the top of the picture towards +x.
    camera.world_from_camera = Isometry3::from_parts(
        Vector3::new(0.0, 0.0, 2.0).into(),
        UnitQuaternion::from_euler_angles(0.0, std::f32::consts::FRAC_PI_2, 0.0),
    );
    let ground = cuboid([3.0, 3.0, 0.1], [0.0, 0.0, -0.1], [0.5; 3]);
    let post = cuboid([0.1, 0.1, 0.1], [0.0, 0.0, 0.9], RED);
    let mut scene = Scene {
        visuals: vec![ground],
        lighting: Lighting {
            sun_direction: [-0.6, 0.0, 0.8],
            ..Lighting::default()
        },
    };
    let mut renderer = Renderer::new();
    let bare = renderer.render(&scene, &camera);
    scene.visuals.push(post);
    let shaded = renderer.render(&scene, &camera);
    // The shadow of something at height 0.9 falls 0.9 * 0.6 / 0.8 = 0.675 m towards +x.
    let row = 40 - (0.675_f32 * 20.0) as u32;
    let (before, after) = (pixel(&bare, row, 40), pixel(&shaded, row, 40));
    assert!(
        brightness(after) + 100 < brightness(before),
        "{before:?} {after:?}"
    );
    let opposite = 40 + (0.675_f32 * 20.0) as u32;
    assert_eq!(pixel(&shaded, opposite, 40), pixel(&bare, opposite, 40));
}

#[test]
fn painted_walls_let_the_sun_through() {
    let ground = cuboid([3.0, 3.0, 0.1], [0.0, 0.0, -0.6], [0.5; 3]);
    let mut roof = cuboid([3.0, 3.0, 0.1], [0.0, 0.0, 1.5], [0.5; 3]);
    let mut camera = camera(20, 20);
    camera.world_from_camera.rotation =
        UnitQuaternion::from_euler_angles(0.0, std::f32::consts::FRAC_PI_2, 0.0);
    let dark = picture(vec![ground, roof], &camera);
    roof.material.texture = Texture::Plaster;
    let bright = picture(vec![ground, roof], &camera);
    assert!(brightness(pixel(&bright, 10, 10)) > brightness(pixel(&dark, 10, 10)) + 100);
}

#[test]
fn a_corner_gets_less_light_from_all_around() {
    let ground = cuboid([3.0, 3.0, 0.1], [0.0, 0.0, -0.6], [0.5; 3]);
    let wall = cuboid([0.1, 3.0, 1.0], [2.1, 0.0, 0.5], [0.5; 3]);
    let scene = Scene {
        visuals: vec![ground, wall],
        lighting: Lighting {
            sun: 0.0,
            headlight: 0.0,
            ..Lighting::default()
        },
    };
    let image = Renderer::new().render(&scene, &camera(80, 80));
    // The wall meets the ground 2 m away: 0.25 below the horizon, 10 rows.
    let (corner, open) = (pixel(&image, 50, 40), pixel(&image, 70, 40));
    assert!(
        brightness(corner) + 40 < brightness(open),
        "{corner:?} {open:?}"
    );
}

#[test]
fn the_same_scene_gives_the_same_bytes_whatever_was_drawn_before() {
    let textures = [
        Texture::Plain,
        Texture::Wood,
        Texture::Floor,
        Texture::Fabric,
        Texture::Checks,
        Texture::Stripes,
        Texture::Label,
        Texture::Plaster,
        Texture::Picture,
        Texture::Knit,
    ];
    let visuals = (0..30).map(|nth| {
        let at = [1.0 + 0.05 * nth as f32, (nth % 7) as f32 * 0.2 - 0.6, -0.3];
        let mut visual = cuboid([0.08, 0.07, 0.1], at, [0.6, 0.5, 0.4]);
        visual.material.texture = textures[nth % textures.len()];
        visual.material.specular = 0.5;
        visual
    });
    let scene = Scene {
        visuals: visuals.collect(),
        lighting: Lighting::default(),
    };
    let fresh = Renderer::new().render(&scene, &camera(45, 80));
    let mut used = Renderer::new();
    let empty = Scene {
        visuals: Vec::new(),
        lighting: Lighting::default(),
    };
    used.render(&scene, &camera(90, 160));
    used.render(&empty, &camera(10, 10));
    assert_eq!(used.render(&scene, &camera(45, 80)), fresh);
    let colours: std::collections::HashSet<_> = fresh.rgb().chunks(3).collect();
    assert!(colours.len() > 100, "textures show: {}", colours.len());
}

#[test]
fn an_empty_picture_has_no_pixels() {
    assert!(picture(Vec::new(), &camera(0, 40)).rgb().is_empty());
}

#[test]
fn brighter_light_gives_a_brighter_picture() {
    let visuals = vec![cuboid([0.5, 0.5, 0.5], [1.5, 0.0, -0.3], [0.4; 3])];
    let lit = |factor: f32| {
        let scene = Scene {
            visuals: visuals.clone(),
            lighting: Lighting {
                sun: factor,
                ambient: factor,
                headlight: factor,
                ..Lighting::default()
            },
        };
        let image = Renderer::new().render(&scene, &camera(40, 40));
        brightness(pixel(&image, 25, 20))
    };
    assert!(lit(0.8) < lit(1.0) && lit(1.0) < lit(1.2));
}

#[test]
fn several_cameras_see_what_each_would_see_alone() {
    let scene = Scene {
        visuals: vec![
            cuboid([0.2, 0.3, 0.1], [1.2, 0.1, -0.2], RED),
            cuboid([2.0, 2.0, 0.02], [1.5, 0.0, -0.4], BLUE),
        ],
        lighting: Lighting::default(),
    };
    let near = camera(18, 32);
    let mut far = near;
    far.world_from_camera.translation.vector = Vector3::new(-0.5, 0.3, 0.2);
    let mut renderer = Renderer::new();
    let together = renderer.render_each(&scene, [&near, &far]);
    assert_ne!(together[0], together[1]);
    assert_eq!(
        together,
        [&near, &far].map(|camera| Renderer::new().render(&scene, camera))
    );
}
