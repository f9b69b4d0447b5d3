//! The checksum of a frame, and the byte by which each message takes part in it.
//!
//! A frame's checksum covers a byte that isn't sent and depends on the message's name and fields: two sides with different
//! definitions don't understand one another by mistake. A frame whose message is not in the list can't be checked.
//! Source: MAVLink guide, "Packet Serialization" and "CRC_EXTRA Calculation"; the list is worked out from the definitions
//! that ArduPilot speaks (ardupilotmega.xml with its includes, as of mavlink 0.21).

/// What is known of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Known {
    /// Its byte in the checksum.
    pub extra: u8,
    /// Length of its payload without extensions, which is its length in the first version.
    pub base_bytes: u8,
}

/// What is known of a message by its id; `None` for one that isn't in the list.
pub fn known(message_id: u32) -> Option<Known> {
    let at = MESSAGES.binary_search_by_key(&message_id, |(id, ..)| *id).ok()?;
    MESSAGES.get(at).map(|(_, extra, base_bytes)| Known { extra: *extra, base_bytes: *base_bytes })
}

/// CRC-16/MCRF4XX over `bytes`, going on from `crc`, which is 0xFFFF at first.
pub fn accumulate(crc: u16, bytes: &[u8]) -> u16 {
    bytes.iter().fold(crc, |crc, byte| {
        let [low, high] = crc.to_le_bytes();
        let mixed = byte ^ low;
        let mixed = mixed ^ (mixed << 4);
        let word = u16::from(mixed);
        u16::from(high) ^ (word << 8) ^ (word << 3) ^ (word >> 4)
    })
}

/// Id, byte in the checksum, length without extensions; by id.
#[rustfmt::skip]
const MESSAGES: [(u32, u8, u8); 325] = [
    (0, 50, 9), (1, 124, 31), (2, 137, 12), (4, 237, 14), (5, 217, 28),
    (6, 104, 3), (7, 119, 32), (8, 117, 36), (11, 89, 6), (20, 214, 20),
    (21, 159, 2), (22, 220, 25), (23, 168, 23), (24, 24, 30), (25, 23, 101),
    (26, 170, 22), (27, 144, 26), (28, 67, 16), (29, 115, 14), (30, 39, 28),
    (31, 246, 32), (32, 185, 28), (33, 104, 28), (34, 237, 22), (35, 244, 22),
    (36, 222, 21), (37, 212, 6), (38, 9, 6), (39, 254, 37), (40, 230, 4),
    (41, 28, 4), (42, 28, 2), (43, 132, 2), (44, 221, 4), (45, 232, 2),
    (46, 11, 2), (47, 153, 3), (48, 41, 13), (49, 39, 12), (50, 78, 37),
    (51, 196, 4), (54, 15, 27), (55, 3, 25), (61, 167, 72), (62, 183, 26),
    (63, 119, 181), (64, 191, 225), (65, 118, 42), (66, 148, 6), (67, 21, 4),
    (69, 243, 11), (70, 124, 18), (73, 38, 37), (74, 20, 20), (75, 158, 35),
    (76, 152, 33), (77, 143, 3), (80, 14, 4), (81, 106, 22), (82, 49, 39),
    (83, 22, 37), (84, 143, 53), (85, 140, 51), (86, 5, 53), (87, 150, 51),
    (89, 231, 28), (90, 183, 56), (91, 63, 42), (92, 54, 33), (93, 47, 81),
    (100, 175, 26), (101, 102, 32), (102, 158, 32), (103, 208, 20), (104, 56, 32),
    (105, 93, 62), (106, 138, 44), (107, 108, 64), (108, 32, 84), (109, 185, 9),
    (110, 84, 254), (111, 34, 16), (112, 174, 12), (113, 124, 36), (114, 237, 44),
    (115, 4, 64), (116, 76, 22), (117, 128, 6), (118, 56, 14), (119, 116, 12),
    (120, 134, 97), (121, 237, 2), (122, 203, 2), (123, 250, 113), (124, 87, 35),
    (125, 203, 6), (126, 220, 79), (127, 25, 35), (128, 226, 35), (129, 46, 22),
    (130, 29, 13), (131, 223, 255), (132, 85, 14), (133, 6, 18), (134, 229, 43),
    (135, 203, 8), (136, 1, 22), (137, 195, 14), (138, 109, 36), (139, 168, 43),
    (140, 181, 41), (141, 47, 32), (142, 72, 243), (143, 131, 14), (144, 127, 93),
    (146, 103, 100), (147, 154, 36), (148, 178, 60), (149, 200, 30), (150, 134, 42),
    (151, 219, 8), (152, 208, 4), (153, 188, 12), (154, 84, 15), (155, 22, 13),
    (156, 19, 6), (157, 21, 15), (158, 134, 14), (160, 78, 12), (161, 68, 3),
    (162, 189, 8), (163, 127, 28), (164, 154, 44), (165, 21, 3), (166, 21, 9),
    (167, 144, 22), (168, 1, 12), (169, 234, 18), (170, 73, 34), (171, 181, 66),
    (172, 22, 98), (173, 83, 8), (174, 167, 48), (175, 138, 19), (176, 234, 3),
    (177, 240, 20), (178, 47, 24), (179, 189, 29), (180, 52, 45), (181, 174, 4),
    (182, 229, 40), (183, 85, 2), (184, 159, 206), (185, 186, 7), (186, 72, 29),
    (191, 92, 27), (192, 36, 44), (193, 71, 22), (194, 98, 25), (195, 120, 37),
    (200, 134, 42), (201, 205, 14), (214, 69, 8), (215, 101, 3), (216, 50, 3),
    (217, 202, 6), (218, 17, 7), (219, 162, 2), (225, 208, 65), (226, 207, 8),
    (230, 163, 42), (231, 105, 40), (232, 151, 63), (233, 35, 182), (234, 150, 40),
    (235, 179, 42), (241, 90, 32), (242, 104, 52), (243, 85, 53), (244, 95, 6),
    (245, 130, 2), (246, 184, 38), (247, 81, 19), (248, 8, 254), (249, 204, 36),
    (250, 49, 30), (251, 170, 18), (252, 44, 18), (253, 83, 51), (254, 46, 9),
    (256, 71, 42), (257, 131, 9), (258, 187, 32), (259, 92, 235), (260, 146, 5),
    (261, 179, 27), (262, 12, 18), (263, 133, 255), (264, 49, 28), (265, 26, 16),
    (266, 193, 255), (267, 35, 255), (268, 14, 4), (269, 109, 213), (270, 59, 19),
    (271, 22, 52), (275, 126, 31), (276, 18, 49), (277, 62, 30), (280, 70, 33),
    (281, 48, 13), (282, 123, 35), (283, 74, 144), (284, 99, 32), (285, 137, 40),
    (286, 210, 53), (287, 1, 23), (288, 20, 23), (290, 251, 46), (291, 10, 57),
    (295, 234, 12), (296, 158, 41), (299, 19, 96), (300, 217, 22), (301, 243, 58),
    (310, 28, 17), (311, 95, 116), (320, 243, 20), (321, 88, 2), (322, 243, 149),
    (323, 78, 147), (324, 132, 146), (330, 23, 158), (331, 91, 230), (332, 236, 239),
    (333, 231, 109), (334, 72, 10), (335, 225, 24), (336, 245, 84), (339, 199, 5),
    (340, 99, 70), (345, 209, 21), (350, 232, 20), (360, 11, 25), (361, 93, 33),
    (370, 75, 87), (371, 10, 26), (372, 26, 140), (373, 117, 42), (375, 251, 140),
    (376, 199, 8), (380, 232, 20), (385, 147, 133), (386, 132, 16), (387, 4, 72),
    (388, 8, 37), (390, 156, 238), (395, 0, 212), (396, 50, 160), (397, 182, 108),
    (400, 110, 254), (401, 183, 6), (410, 160, 53), (411, 106, 3), (412, 33, 6),
    (413, 77, 7), (435, 134, 46), (436, 193, 9), (437, 30, 1), (440, 66, 35),
    (9000, 113, 137), (9005, 117, 34), (10001, 209, 20), (10002, 186, 41), (10003, 4, 1),
    (10004, 133, 9), (10005, 103, 9), (10006, 193, 4), (10007, 71, 17), (10008, 240, 14),
    (10151, 195, 85), (11000, 134, 51), (11001, 15, 135), (11002, 234, 179), (11003, 64, 5),
    (11004, 11, 232), (11005, 93, 230), (11010, 46, 49), (11011, 106, 44), (11020, 205, 16),
    (11030, 144, 44), (11031, 133, 44), (11032, 85, 44), (11033, 195, 37), (11034, 79, 5),
    (11035, 128, 8), (11036, 177, 34), (11037, 130, 28), (11038, 47, 38), (11039, 142, 9),
    (11040, 132, 44), (11041, 208, 44), (11042, 201, 44), (11043, 193, 44), (11044, 189, 44),
    (11060, 162, 78), (12900, 114, 44), (12901, 254, 59), (12902, 140, 53), (12903, 249, 46),
    (12904, 77, 54), (12905, 49, 43), (12915, 94, 249), (12918, 139, 51), (12919, 7, 18),
    (12920, 20, 5), (42000, 227, 1), (42001, 239, 46), (50001, 246, 32), (50002, 181, 246),
    (50003, 62, 19), (50004, 240, 10), (50005, 152, 6), (52000, 13, 100), (52001, 239, 1),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// The byte of a message that has these fields, largest type first as they are sent: type, name, length of an array.
    fn extra(name: &str, fields: &[(&str, &str)]) -> u8 {
        let text =
            fields.iter().fold(format!("{name} "), |text, (kind, field)| format!("{text}{kind} {field} "));
        let [low, high] = accumulate(0xFFFF, text.as_bytes()).to_le_bytes();
        low ^ high
    }

    #[test]
    fn the_checksum_is_the_published_one() {
        // Check value of CRC-16/MCRF4XX in the catalogue of parametrised CRC algorithms.
        assert_eq!(accumulate(0xFFFF, b"123456789"), 0x6F91);
    }

    #[test]
    fn the_list_is_in_order_and_no_id_is_twice() {
        assert!(MESSAGES.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn bytes_of_the_messages_in_use_follow_from_their_fields() {
        let axes: Vec<_> = ["xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag"]
            .map(|field| ("int16_t", field))
            .to_vec();
        let boot = vec![("uint32_t", "time_boot_ms")];
        let raw = [vec![("uint64_t", "time_usec")], axes.clone()].concat();
        let scaled = [boot.clone(), axes].concat();
        let angles =
            ["roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"].map(|field| ("float", field));
        let attitude = [boot.clone(), angles.to_vec()].concat();
        let pressures = [("float", "press_abs"), ("float", "press_diff"), ("int16_t", "temperature")];
        let pressure = [boot.clone(), pressures.to_vec()].concat();
        let words = ["min_distance", "max_distance", "current_distance"].map(|field| ("uint16_t", field));
        let bytes = ["type", "id", "orientation", "covariance"].map(|field| ("uint8_t", field));
        let distance = [boot, words.to_vec(), bytes.to_vec()].concat();
        for (id, name, fields, base_bytes) in [
            (26, "SCALED_IMU", &scaled, 22),
            (27, "RAW_IMU", &raw, 26),
            (29, "SCALED_PRESSURE", &pressure, 14),
            (30, "ATTITUDE", &attitude, 28),
            (116, "SCALED_IMU2", &scaled, 22),
            (129, "SCALED_IMU3", &scaled, 22),
            (132, "DISTANCE_SENSOR", &distance, 14),
            (137, "SCALED_PRESSURE2", &pressure, 14),
            (143, "SCALED_PRESSURE3", &pressure, 14),
        ] {
            assert_eq!(known(id), Some(Known { extra: extra(name, fields), base_bytes }), "{name}");
        }
        assert_eq!(known(60_000), None);
    }
}
