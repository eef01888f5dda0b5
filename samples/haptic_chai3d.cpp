/* Connects a device to `ebpo haptic --device udp:PORT`, by CHAI3D 3. The device is the pen or the
 * tool; its first switch lifts the pen. Only compiled and run with a stub of CHAI3D
 * (tests/support/haptic_stubs), never with a real device.
 *
 *     c++ -I CHAI3D/src samples/haptic_chai3d.cpp -o haptic_chai3d -lchai3d
 *     haptic_chai3d PORT X Y Z SCALE STIFFNESS
 *
 * X Y Z: position in the model at the origin of the device. SCALE: the model's unit in metres of
 * the device is 1 / SCALE. STIFFNESS: that of --stiffness, which is the wanted stiffness in N/m
 * divided by SCALE. SIGINT and SIGTERM end the device with force 0. */
#include <cstdio>
#include <cstdlib>

#include "chai3d.h"

#include "haptic_link.h"

int main(int argc, char **argv)
{
    if (argc != 7) {
        std::fprintf(stderr, "usage: haptic_chai3d PORT X Y Z SCALE STIFFNESS\n");
        return 2;
    }
    const double origin[3] = { std::atof(argv[2]), std::atof(argv[3]), std::atof(argv[4]) };
    const double scale = std::atof(argv[5]);
    chai3d::cHapticDeviceHandler handler;
    chai3d::cGenericHapticDevicePtr device;
    haptic_link link;
    if (!handler.getDevice(device, 0) || !device->open() || !device->calibrate() ||
        !haptic_link_open(&link, std::atoi(argv[1]), std::atof(argv[6]),
                          device->getSpecifications().m_maxLinearForce)) {
        std::fprintf(stderr, "haptic_chai3d: the device or a socket cannot be opened, or STIFFNESS "
                             "is not above 0\n");
        return 1;
    }
    chai3d::cVector3d at;
    bool continues = true;
    while (continues && device->getPosition(at)) { /* false: the device is unplugged */
        chai3d::cMatrix3d matrix;
        chai3d::cQuaternion q;
        bool pressed = false;
        double force[3];
        device->getRotation(matrix);
        device->getUserSwitch(0, pressed);
        q.fromRotMat(matrix);
        /* CHAI3D: x to the user, y to the right, z up. The viewer: z to the user, x, y. */
        const double position[3] = { origin[0] + scale * at.y(), origin[1] + scale * at.z(),
                                     origin[2] + scale * at.x() };
        const double rotation[4] = { q.y, q.z, q.x, q.w };
        continues = haptic_link_exchange(&link, position, rotation, pressed, force);
        device->setForce(chai3d::cVector3d(force[2], force[0], force[1]));
        chai3d::cSleepMs(1);
    }
    device->setForce(chai3d::cVector3d(0, 0, 0));
    haptic_link_close(&link);
    device->close();
    return 0;
}
