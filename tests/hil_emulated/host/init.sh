#!/bin/busybox sh
# First process of the emulated computer: loads the kernel's modules, makes the host's file system
# its own (changes stay in memory), and runs /out/start.sh there.
/bin/busybox --install -s /bin
export PATH=/bin
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t devtmpfs dev /dev
for module in /modules/*.ko; do
  insmod "$module" || echo "emulated computer: $module was not loaded"
done
mount -t 9p -o trans=virtio,version=9p2000.L,msize=1048576,cache=loose,ro host_root /lower
mount -t tmpfs tmpfs /rw
mkdir /rw/upper /rw/work
mount -t overlay -o lowerdir=/lower,upperdir=/rw/upper,workdir=/rw/work overlay /newroot
mkdir -p /newroot/modules /newroot/out /newroot/dev
cp /on_request/*.ko /newroot/modules/
for folder in proc sys dev; do mount --move /$folder /newroot/$folder; done
mkdir -p /newroot/dev/pts /newroot/dev/shm
mount -t devpts devpts /newroot/dev/pts
mount -t tmpfs tmpfs /newroot/dev/shm
mount -t tmpfs tmpfs /newroot/run
mount -t 9p -o trans=virtio,version=9p2000.L,msize=1048576,cache=none host_out /newroot/out
ip link set lo up
ip link set eth0 up
ip addr add 10.0.2.15/24 dev eth0
chroot /newroot /bin/sh /out/start.sh
sync
poweroff -f
