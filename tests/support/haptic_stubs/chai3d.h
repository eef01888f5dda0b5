/* A stub of the part of CHAI3D that samples/haptic_chai3d.cpp uses: declarations, and a device that
 * moves 0.3 m down and up again in a second, and is then unplugged. It begins 0.05 m beside its
 * origin, and measures the energy that it gives to the hand. */
#ifndef EBPO_TESTS_STUB_CHAI3D_H
#define EBPO_TESTS_STUB_CHAI3D_H

#include <cstdio>
#include <ctime>

namespace chai3d
{

class cVector3d
{
  public:
    explicit cVector3d(double x = 0, double y = 0, double z = 0) : v{ x, y, z } {}
    double x() const { return v[0]; }
    double y() const { return v[1]; }
    double z() const { return v[2]; }

  private:
    double v[3];
};

class cMatrix3d
{
};

class cQuaternion
{
  public:
    double w = 1, x = 0, y = 0, z = 0;
    void fromRotMat(const cMatrix3d &) {}
};

struct cHapticDeviceInfo {
    double m_maxLinearForce = 3.3;
};

class cGenericHapticDevice
{
  public:
    bool open() { return true; }
    bool calibrate() { return true; }
    bool close()
    {
        std::printf("device: %d positions, last force %.2f, energy %.9f, strongest force up %.2f\n",
                    count, last.z(), energy, strongest);
        return true;
    }
    cHapticDeviceInfo getSpecifications() { return {}; }
    bool getPosition(cVector3d &out)
    {
        count++;
        out = cVector3d(0, 0.05, -0.3 * (count < 500 ? count : 1000 - count) / 500);
        energy += last.z() * (out.z() - before.z()); /* begins without a force */
        before = out;
        return count < 1000;
    }
    bool getRotation(cMatrix3d &) { return true; }
    bool getUserSwitch(int, bool &out)
    {
        out = false;
        return true;
    }
    bool setForce(const cVector3d &force)
    {
        last = force;
        strongest = force.z() > strongest ? force.z() : strongest;
        return true;
    }

  private:
    int count = 0;
    double strongest = 0, energy = 0;
    cVector3d before, last;
};

typedef cGenericHapticDevice *cGenericHapticDevicePtr;

class cHapticDeviceHandler
{
  public:
    bool getDevice(cGenericHapticDevicePtr &out, unsigned index)
    {
        out = &device;
        return index == 0;
    }

  private:
    cGenericHapticDevice device;
};

inline void cSleepMs(unsigned milliseconds)
{
    const std::timespec time = { 0, 1000000L * milliseconds };
    nanosleep(&time, nullptr);
}

} // namespace chai3d

#endif
