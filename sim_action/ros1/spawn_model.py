import os, sys
sys.path.append(os.environ["SIM_ACTION_ROS_MODULES"])
import rospy
from gazebo_msgs.srv import SpawnModel, SpawnModelRequest
def main():
    a = rospy.myargv()[1:]
    rospy.init_node("spawn_model")
    rospy.wait_for_service("/gazebo/spawn_urdf_model")
    r = SpawnModelRequest(); r.model_name = a[a.index("-model")+1]; r.model_xml = rospy.get_param(a[a.index("-param")+1])
    print(rospy.ServiceProxy("/gazebo/spawn_urdf_model", SpawnModel)(r).success)
main()
