//! Images that another device sees: through shared memory where the driver has it, through the host where not.
#![cfg(all(feature = "external", unix))]

use crate::common::scenes::{Kind, random_case};
use crate::host::engine::Engine;
use crate::host::{Host, assert_silent, error, forward, rasterizer, submit};
use ash::vk;
use softras::Error;
use softras::embed::BufferId;
use softras::embed::external::{External, ExternalBuffer, ExternalSemaphore, ExternalSupport};
use std::os::fd::OwnedFd;

const USAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::TRANSFER_DST.as_raw() | vk::BufferUsageFlags::TRANSFER_SRC.as_raw(),
);

/// Copies bytes between buffers, and waits.
fn copy(engine: &Engine, from: (vk::Buffer, u64), to: vk::Buffer, size: u64) {
    submit(engine, |commands| {
        let region = [vk::BufferCopy { src_offset: from.1, dst_offset: 0, size }];
        unsafe { engine.device().cmd_copy_buffer(commands.raw(), from.0, to, &region) };
    });
}

/// One that the driver never sees.
fn any_descriptor() -> OwnedFd {
    std::fs::File::open("/dev/null").unwrap().into()
}

/// softras' image of one device, in a buffer of another.
#[test]
fn another_device_sees_the_image() {
    let plain = crate::host::engine();
    let support = ExternalSupport::of(&plain.host_adapter(), USAGE).unwrap();
    println!("{support:?}");
    let no_support = ExternalSupport { memory: false, semaphores: false };
    for support in [support, no_support] {
        let mut extensions = Vec::new();
        if support.memory {
            extensions.push(ash::khr::external_memory_fd::NAME);
        }
        if support.semaphores {
            extensions.push(ash::khr::external_semaphore_fd::NAME);
        }
        let engines = [0, 1].map(|_| Engine::with_extensions(true, &extensions).unwrap());
        let devices = engines.each_ref().map(Engine::host_device);
        let rasterizer = rasterizer(&engines[0]);
        let case = random_case(20, Kind::Plain);
        let host = Host::new(&engines[0], &rasterizer, &case);
        forward(&engines[0], &rasterizer, &host);
        let (offset, size) = host.arena.part(BufferId::Status).unwrap();
        let image =
            host.plan.buffers().iter().find(|b| [BufferId::Color, BufferId::Silhouette].contains(&b.id)).unwrap().id;
        let (offset, size) = host.arena.part(image).unwrap_or((offset, size));

        let ours = ExternalBuffer::new(&devices[0], size, USAGE, support).unwrap();
        copy(&engines[0], (host.buffer.raw, offset), ours.raw(), size);
        let exported = ours.export().unwrap();
        assert_eq!(matches!(exported, External::Memory(_)), support.memory);
        let theirs = unsafe { ExternalBuffer::import(&devices[1], size, USAGE, exported) }.unwrap();
        let read = |buffer: vk::Buffer| {
            let location = gpu_allocator::MemoryLocation::GpuToCpu;
            let back = engines[1].buffer(size, vk::BufferUsageFlags::TRANSFER_DST, location).unwrap();
            copy(&engines[1], (buffer, 0), back.raw, size);
            back.bytes()[..size as usize].to_vec()
        };
        let expected = &host.buffer.bytes()[offset as usize..][..size as usize];
        assert!(expected.iter().any(|&byte| byte != expected[0]), "an empty image");
        assert_eq!(read(theirs.raw()), expected);

        // What is written later is seen at once, or after another export.
        submit(&engines[0], |commands| unsafe {
            engines[0].device().cmd_fill_buffer(commands.raw(), ours.raw(), 0, vk::WHOLE_SIZE, 0x0707_0707);
        });
        let seen = read(theirs.raw());
        assert!(if support.memory { seen.iter().all(|&byte| byte == 7) } else { seen == expected });
        let again = unsafe { ExternalBuffer::import(&devices[1], size, USAGE, ours.export().unwrap()) }.unwrap();
        assert!(read(again.raw()).iter().all(|&byte| byte == 7));
        let short = error(unsafe { ExternalBuffer::import(&devices[1], size, USAGE, External::Bytes(vec![0; 3])) });
        assert!(short.contains("3 bytes"), "{short}");

        let semaphore = ExternalSemaphore::new(&devices[0], support);
        if support.semaphores {
            let fd = semaphore.unwrap().export().unwrap();
            unsafe { ExternalSemaphore::import(&devices[1], support, fd) }.unwrap();
        } else {
            assert!(matches!(semaphore, Err(Error::NoDevice { .. })));
            let refused = unsafe { ExternalSemaphore::import(&devices[1], support, any_descriptor()) };
            let refused = error(refused);
            assert!(refused.contains("shares no semaphores") && refused.contains("fence"), "{refused}");
        }
        drop((theirs, again, ours, host, rasterizer));
        for engine in engines {
            assert_silent(engine);
        }
    }
    // A device without the extension is told so.
    let device = plain.host_device();
    let claimed = ExternalSupport { memory: true, semaphores: true };
    let missing = error(ExternalBuffer::new(&device, 16, USAGE, claimed));
    assert!(missing.contains("VK_KHR_external_memory_fd"), "{missing}");
    let missing = error(ExternalSemaphore::new(&device, claimed));
    assert!(missing.contains("VK_KHR_external_semaphore_fd"), "{missing}");
    let missing = error(unsafe { ExternalSemaphore::import(&device, claimed, any_descriptor()) });
    assert!(missing.contains("VK_KHR_external_semaphore_fd"), "{missing}");
    let nothing = error(ExternalBuffer::new(&device, 0, USAGE, ExternalSupport { memory: false, semaphores: false }));
    assert!(nothing.contains("no bytes"), "{nothing}");
    let odd = vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
    let odd = error(ExternalBuffer::new(&device, 16, odd, ExternalSupport { memory: false, semaphores: false }));
    assert!(odd.contains("SHADER_DEVICE_ADDRESS"), "{odd}");
    assert_silent(plain);
}
