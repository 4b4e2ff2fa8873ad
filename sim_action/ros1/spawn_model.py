import os, sys, json
from pathlib import Path
from sim_action.ros1.exchange import FOLDER_VARIABLE, REQUEST_FILE, Request

sys.path.append(Request.model_validate_json((Path(os.environ[FOLDER_VARIABLE]) / REQUEST_FILE).read_bytes()).modules)
import rospy
from gazebo_msgs.srv import SpawnModel, SpawnModelRequest


def main():
    a = rospy.myargv()[1:]
    rospy.init_node("spawn_model")
    rospy.wait_for_service("/gazebo/spawn_urdf_model")
    r = SpawnModelRequest()
    r.model_name = a[a.index("-model") + 1]
    r.model_xml = rospy.get_param(a[a.index("-param") + 1])
    print(rospy.ServiceProxy("/gazebo/spawn_urdf_model", SpawnModel)(r).success)


main()
